"""Write the parts of docs/ that are made from tables and imports; with --check, exit 1 if one is outdated.

python -m tools.make pages [--check]
"""

import re
import sys
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Annotated

from mpucal.chip.families import FAMILIES
from mpucal.data import Sensor
from mpucal.export.forms import FORMS
from mpucal.reasons import KINDS, Kind
from mpucal.result.session_files import SESSION_FILES
from mpucal.session.aims import AIMS, select_aim
from mpucal.simulated.faults import OF_CHIP, OF_VEHICLE, Where, fault_kinds
from mpucal.sinks.choose import source_flags
from mpucal.sinks.table import SINKS
from mpucal.sources.kind import Option, SourceKind
from mpucal.sources.table import SOURCES, unique

from . import keys
from .drawings import arrows, diagram, rooms

ROOT = Path(__file__).parents[2]
MADE = re.compile(r"(?<=<!-- python -m tools.make pages: )(\w+)( -->\n).*?(?=<!-- end -->)", re.DOTALL)
REASONS = """# The reasons against a calibration

The verdict of a calibration is *good* if there is no reason against it. Otherwise `quality.reasons` in
`calibration.json` lists the reasons, each with `code`, `message` (what is wrong and what to do) and `remedy` (what to
do). A reason that refuses the calibration makes the verdict *refused*, the others make it *usable*. Codes never change
their meaning, but new codes may be added.

`python -m tools.make pages` makes this page from the table in `mpucal/reasons.toml`; … stands for a number or a name.
You can see every reason without a board: in a session on the simulated chip, or by changing a good recording:

    from dataclasses import replace
    import mpucal
    r = mpucal.load("fixtures/sessions/mpu6050.mcap")
"""
REFUSES = {"always": "It always refuses the calibration.", "never": "It never refuses the calibration."}
SOURCES_HEAD = """# Sources

A command that measures takes exactly one source. `python -m tools.make pages` makes this page from the table in
`mpucal/sources/table.py`. The options, their help and their messages follow from the same table.
"""


def reasons() -> str:
    """Return the page of the reasons."""
    overview = ["| code | what it means | refuses |", "|---|---|---|"]
    overview += [f"| [`{code}`](#{code}) | {kind.meaning} | {kind.refuses} |" for code, kind in KINDS.items()]
    return (
        "\n".join([REASONS, *overview, *(line for code, kind in KINDS.items() for line in _section(code, kind))]) + "\n"
    )


def _section(code: str, kind: Kind) -> list[str]:
    refuses = f"It refuses the calibration if {kind.refused_when}." if kind.refused_when else REFUSES[kind.refuses]
    # a | would end the cell; numbers and names replace the braces
    cells = [
        [re.sub(r"\{[^}]*\}", "…", text).replace("|", "\\|") for text in (s.what, s.remedy)]
        for s in kind.sentences.values()
    ]
    again = " Turning the board again from the start may help." if kind.turn_again else ""
    return [
        *("", f"## {code}", ""),
        *(f"{kind.meaning} {refuses}{again}", ""),
        *("| what is wrong | what to do |", "|---|---|", *(_row(*row) for row in cells)),
        *("", "To see it:", "", f"    {kind.reproduce}"),
    ]


def sources() -> str:
    """Return the page of the sources."""
    lines = ["| source | is | its value | its options | commands |", "|---|---|---|---|---|"]
    options = ["| option | what it sets | default | of |", "|---|---|---|---|"]
    rows = unique(option for kind in SOURCES for option in (*kind.options, *kind.settings))
    return "\n".join([SOURCES_HEAD, *lines, *map(_source, SOURCES), "", *options, *map(_option, rows)]) + "\n"


def _source(kind: SourceKind) -> str:
    beside = _listed(option.flag for option in (*kind.options, *kind.settings)) or "none"
    return _row(f"`{kind.flag}`", kind.what, kind.forms, beside, _listed(kind.commands))


def _option(option: Option) -> str:
    value = "\\|".join(option.choices) or option.metavar
    default = "none" if option.default is None else f"{float(option.default):g}"
    kinds = (kind.flag for kind in SOURCES if option in (*kind.options, *kind.settings))
    return _row(f"`{option.flag} {value}`", option.help, default, _listed(kinds))


def sinks() -> str:
    """Return the table of the sinks."""
    rows = (
        _row(f"`{kind.name}`", _listed(source_flags(kind)), "yes" if kind.default else "no", kind.where, kind.holds)
        for kind in SINKS.values()
    )
    return "\n".join(["| `--to` | of | by default | where | what it holds |", "|---|---|---|---|---|", *rows])


def forms() -> str:
    """Return the table of the export forms."""
    rows = (_row(f"`{form.name}`", form.read_by, form.applied) for form in FORMS)
    return "\n".join(["| form | read by | applied as |", "|---|---|---|", *rows])


def files() -> str:
    """Return the table of the files that a session may leave."""
    left = (*SESSION_FILES, *(file for kind in SINKS.values() for file in kind.session_files))
    rows = (_row(f"`{file.name}`", file.what.replace("](firm", "](../firm")) for file in left)
    return "\n".join(["| file | what |", "|---|---|", *rows])


def chips() -> str:
    """Return the table of the families of chips."""
    rows = []
    for family in FAMILIES:
        wide = f", {family.widest_fifo_bytes} once ACCEL_CONFIG2 asks for it" if family.widest_fifo_bytes else ""
        offsets = ", ".join(f"0x{address:02X}" for address in family.accel_offset_h)
        temperature = f"raw / {family.lsb_per_c:g} + {family.zero_c:g}"
        parts = ", ".join(f"0x{who_am_i:02X} {chip}" for who_am_i, chip in family.parts)
        rows.append(_row(family.name, f"{family.fifo_bytes}{wide}", offsets, temperature, parts, family.source))
    head = "family", "FIFO, bytes", "accelerometer offsets at", "temperature, °C", "WHO_AM_I", "source"
    return "\n".join([_row(*head), f"|{'---|' * 6}", *rows])


def faults(*where: Where, timed: str = "") -> str:
    """Return a table of faults of the simulation; `timed` is written behind the names of those that take a time."""
    rows = (_row(f"{kind.name}{timed * kind.timed}", kind.what) for kind in fault_kinds(*where).values())
    return "\n".join(["| name | what happens |", "|---|---|", *rows])


def targets() -> str:
    """Return the table of the targets of a session."""
    head = "bias", "scale factor error", "misalignment", "orientations at least", "turning at most", "verified by"
    rows = []
    for sensor, of in ((None, ""), (Sensor(message="SCALED_IMU"), ", vehicle")):
        for name in AIMS:
            aim = select_aim(name, sensor)
            std = aim.target
            uncertainties = f"{std.bias_mg:.2g} mg", f"{std.gain_pct:.2g} %", f"{std.misalignment_deg:.2g} deg"
            rows.append(_row(f"`{name}`{of}", *uncertainties, str(aim.least), f"{aim.longest_s:g} s", str(aim.verify)))
    return "\n".join([_row("`--target` (1 sigma)", *head), f"|{'---|' * 7}", *rows])


def _listed(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


# files that are made whole, and parts of pages between `<!-- python -m tools.make pages: NAME -->` and
# `<!-- end -->`
WHOLE: dict[str, Callable[[], str]] = {
    "docs/reasons.md": reasons,
    "docs/sources.md": sources,
    "mpucal/result/calibration.schema.json": keys.text,
}
PARTS: dict[str, Callable[[], str]] = {
    "rooms": lambda: rooms(arrows()),
    "states": diagram,
    "targets": targets,
    "files": files,
    "sinks": sinks,
    "forms": forms,
    "chips": chips,
    "faults": partial(faults, *OF_CHIP, Where.HAND),
    "defects": partial(faults, Where.DEFECT),
    "vehicle_faults": partial(faults, *OF_VEHICLE, timed="@"),
    "keys": keys.table,
}


def outdated() -> Iterator[tuple[Path, str]]:
    """Yield the files that are not what they should be, and what they should be."""
    pages = {path: path.read_text(encoding="utf-8") for path in (ROOT / "docs").rglob("*.md")}
    made = {
        path: MADE.sub(lambda part: f"{part[1]}{part[2]}{PARTS[part[1]]()}\n\n", old) for path, old in pages.items()
    }
    made |= {ROOT / name: make() for name, make in WHOLE.items()}
    for path, new in made.items():
        if new != path.read_text(encoding="utf-8"):
            yield path, new


def main(*, check: Annotated[bool, "write nothing"] = False) -> int:
    """Write or check; return the exit code."""
    found = list(outdated())
    for path, new in found:
        print(f"{path} is outdated" if check else f"{path} is written", file=sys.stderr)
        if not check:
            path.write_text(new, encoding="utf-8")
    return int(check and bool(found))
