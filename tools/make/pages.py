"""Write what docs/ shows of tables and imports: drawings and pages; with --check, exit 1 where it shows something else.

python -m tools.make pages [--check]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from . import draw_rooms, draw_session, reasons, sources

DOCS = Path(__file__).parents[2] / "docs"
# of each page what makes it of what it was
PAGES: dict[str, Callable[[str], str]] = {
    "architecture.md": draw_rooms.page,
    "session.md": draw_session.page,
    "reasons.md": reasons.page,
    "sources.md": sources.page,
}


def outdated() -> Iterator[tuple[Path, str]]:
    """The pages that are not what they should be, and what they should be."""
    for name, page in PAGES.items():
        old = (DOCS / name).read_text(encoding="utf-8")
        if (new := page(old)) != old:
            yield DOCS / name, new


def main() -> int:
    """Write or check; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing")
    check, found = parser.parse_args().check, list(outdated())
    for path, new in found:
        print(f"{path} is outdated" if check else f"{path} is written", file=sys.stderr)
        if not check:
            path.write_text(new, encoding="utf-8")
    return int(check and bool(found))
