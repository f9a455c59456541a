"""The table of sinks against the documentation's copy of it."""

import re
from pathlib import Path

from mpucal.sinks.choose import source_flags
from mpucal.sinks.table import SINKS

PAGE = Path(__file__).parents[2] / "docs" / "use.md"


def quoted(sources):
    return ", ".join(f"`{source}`" for source in sources)


def test_the_documentation_has_the_same_rows():
    section = re.search(r"## Where a session leaves it\n(.*?)\n\n[^|]", PAGE.read_text(encoding="utf-8"), re.DOTALL)[1]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in section.strip().splitlines()[2:]]
    assert rows == [
        [f"`{kind.name}`", quoted(source_flags(kind)), "yes" if kind.default else "no", kind.where, kind.holds]
        for kind in SINKS.values()
    ]
