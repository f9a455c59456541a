"""Write what docs/ shows of tables and imports: drawings and pages; with --check, exit 1 where it shows something else.

python -m tools.make pages [--check]
"""

from __future__ import annotations

import argparse
import ast
import re
import sys
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import grimp

from mpucal.reasons import KINDS, Kind
from mpucal.session.events import Abort
from mpucal.session.table import TRANSITIONS, State
from mpucal.sources.kind import Option, SourceKind
from mpucal.sources.table import SOURCES, unique

from . import keys

ROOT = Path(__file__).parents[2]
PACKAGE = "mpucal"
MADE = re.compile(r"(?<=<!-- made by python -m tools.make pages -->\n).*?(?=<!-- end -->)", re.DOTALL)
STATES = re.compile(r"(?<=```mermaid\n).*?(?=```)", re.DOTALL)
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
Arrows = dict[str, set[str]]


def arrows() -> Arrows:
    """Return by room the rooms that it imports."""
    graph = grimp.build_graph(PACKAGE, cache_dir=None)
    children = graph.find_children(PACKAGE)
    found: Arrows = {_name(room): set() for room in children}
    for one in children:
        for other in children - {one}:
            if graph.direct_import_exists(importer=one, imported=other, as_packages=True):
                found[_name(one)].add(_name(other))
    return found


def floors(imports: Arrows) -> list[str]:
    """Return the rooms from the bottom up: each one after all that it imports.

    Raises
    ------
    graphlib.CycleError : rooms import each other.
    """
    sorter = TopologicalSorter(imports)
    sorter.prepare()
    order: list[str] = []
    while sorter.is_active():
        ready = sorted(sorter.get_ready())
        order += ready
        sorter.done(*ready)
    return order


def reduced(imports: Arrows) -> Arrows:
    """Return the arrows that no longer way implies."""
    reach: Arrows = {}
    for room in floors(imports):
        reach[room] = imports[room].union(*(reach[lower] for lower in imports[room]))
    return {
        room: {lower for lower in lowers if not any(lower in reach[other] for other in lowers)}
        for room, lowers in imports.items()
    }


def rooms(imports: Arrows) -> str:
    """Return a drawing in Mermaid and a table: rooms from the top down, each with its docstring's first sentence."""
    order = floors(imports)[::-1]
    least = reduced(imports)
    lines = ["```mermaid", "flowchart TD"]
    lines += [
        f"    {room.strip('_')} --> {lower.strip('_')}"
        for room in order
        for lower in sorted(least[room], key=order.index)
    ]
    rows = [f"| `{_path(room).relative_to(ROOT).as_posix()}` | {sentence(_path(room))} |" for room in order]
    return "\n".join([*lines, "```", "", "| room | what it holds |", "|---|---|", *rows]) + "\n\n"


def sentence(path: Path) -> str:
    """Return the first sentence of a module's docstring, or of a package's."""
    source = path / "__init__.py" if path.is_dir() else path
    words = ast.get_docstring(ast.parse(source.read_text(encoding="utf-8"))) or ""
    return re.split(r"(?<=\.)\s", " ".join(words.split("\n\n")[0].split()))[0]


def _path(room: str) -> Path:
    folder = ROOT / PACKAGE / room
    return folder if folder.is_dir() else folder.with_suffix(".py")


def _name(module: str) -> str:
    return module.removeprefix(f"{PACKAGE}.")


def diagram() -> str:
    """Return the table of the session as a Mermaid state diagram; events that change nothing are left out."""
    lines = ["stateDiagram-v2", f"    [*] --> {State.CONNECT.name.lower()}"]
    lines += [f"    {state.name.lower()}: {state}" for state in State]
    for state, row in TRANSITIONS.items():
        events = defaultdict(list)
        for event, following in row.items():
            if following is not state:
                events[following].append(event.__name__)
        lines += [f"    {state.name.lower()} --> {to.name.lower()}: {', '.join(names)}" for to, names in events.items()]
        if Abort not in row:  # an end
            lines.append(f"    {state.name.lower()} --> [*]")
    return "\n".join(lines) + "\n"


def reasons() -> str:
    """Return the page of the reasons."""
    overview = ["| code | what it means | refuses |", "|---|---|---|"]
    overview += [f"| [`{code}`](#{code}) | {kind.meaning} | {kind.refuses} |" for code, kind in KINDS.items()]
    return (
        "\n".join([REASONS, *overview, *(line for code, kind in KINDS.items() for line in _section(code, kind))]) + "\n"
    )


def _section(code: str, kind: Kind) -> list[str]:
    refuses = f"It refuses the calibration if {kind.refused_when}." if kind.refused_when else REFUSES[kind.refuses]
    # a | would end the cell, and a number or name stands where braces are
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


def _listed(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


# of each page or file what makes it of what it was
PAGES: dict[str, Callable[[str], str]] = {
    "docs/architecture.md": lambda old: MADE.sub(lambda _: rooms(arrows()), old),
    "docs/session.md": lambda old: STATES.sub(lambda _: diagram(), old),
    "docs/reasons.md": lambda _: reasons(),
    "docs/sources.md": lambda _: sources(),
    "docs/reference/calibration.md": lambda old: MADE.sub(lambda _: keys.table(), old),
    "mpucal/result/calibration.schema.json": lambda _: keys.text(),
}


def outdated() -> Iterator[tuple[Path, str]]:
    """Yield the pages that are not what they should be, and what they should be."""
    for name, page in PAGES.items():
        path = ROOT / name
        old = path.read_text(encoding="utf-8")
        if (new := page(old)) != old:
            yield path, new


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
