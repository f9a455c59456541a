"""Drawings in Mermaid for docs/: the rooms of mpucal with their imports, and the states of a session."""

import ast
import re
from collections import defaultdict
from graphlib import TopologicalSorter
from pathlib import Path

import grimp

from mpucal.session.events import Abort
from mpucal.session.table import TRANSITIONS, State

ROOT = Path(__file__).parents[2]
PACKAGE = "mpucal"
Arrows = dict[str, set[str]]


def arrows() -> Arrows:
    """Return the rooms that each room imports."""
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
    """Return the arrows that no longer path implies."""
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
    return "\n".join([*lines, "```", "", "| room | what it holds |", "|---|---|", *rows])


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
    lines = ["```mermaid", "stateDiagram-v2", f"    [*] --> {State.CONNECT.name.lower()}"]
    lines += [f"    {state.name.lower()}: {state}" for state in State]
    for state, row in TRANSITIONS.items():
        events = defaultdict(list)
        for event, following in row.items():
            if following is not state:
                events[following].append(event.__name__)
        lines += [f"    {state.name.lower()} --> {to.name.lower()}: {', '.join(names)}" for to, names in events.items()]
        if Abort not in row:  # an end
            lines.append(f"    {state.name.lower()} --> [*]")
    return "\n".join([*lines, "```"])
