"""Draws the rooms of mpucal and what imports what into docs/architecture.md, from the imports themselves."""

from __future__ import annotations

import ast
import re
from graphlib import TopologicalSorter
from pathlib import Path

import grimp

ROOT = Path(__file__).parents[2]
PACKAGE = "mpucal"
DRAWN = re.compile(r"(?<=<!-- made by python -m tools.make pages -->\n).*?(?=<!-- end -->)", re.DOTALL)
Arrows = dict[str, set[str]]


def arrows() -> Arrows:
    """By room, the rooms that it imports."""
    graph = grimp.build_graph(PACKAGE, cache_dir=None)
    rooms = graph.find_children(PACKAGE)
    found: Arrows = {_name(room): set() for room in rooms}
    for one in rooms:
        for other in rooms - {one}:
            if graph.direct_import_exists(importer=one, imported=other, as_packages=True):
                found[_name(one)].add(_name(other))
    return found


def floors(imports: Arrows) -> list[str]:
    """The rooms from the bottom up: each one after all that it imports.

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
    """Without the arrows that a longer way says already."""
    reach: Arrows = {}
    for room in floors(imports):
        reach[room] = imports[room].union(*(reach[lower] for lower in imports[room]))
    return {
        room: {lower for lower in lowers if not any(lower in reach[other] for other in lowers)}
        for room, lowers in imports.items()
    }


def drawing(imports: Arrows) -> str:
    """Mermaid and a table: rooms from the top down, each with the first sentence of its docstring."""
    order = floors(imports)[::-1]
    least = reduced(imports)
    lines = ["```mermaid", "flowchart TD"]
    lines += [f"    {_id(room)} --> {_id(lower)}" for room in order for lower in sorted(least[room], key=order.index)]
    rows = [f"| `{_path(room).relative_to(ROOT).as_posix()}` | {sentence(_path(room))} |" for room in order]
    return "\n".join([*lines, "```", "", "| room | what it holds |", "|---|---|", *rows]) + "\n\n"


def page(old: str) -> str:
    """The document with what the imports are now."""
    return DRAWN.sub(lambda _: drawing(arrows()), old)


def sentence(path: Path) -> str:
    """The first sentence of a module's docstring, or of a package's."""
    source = path / "__init__.py" if path.is_dir() else path
    words = ast.get_docstring(ast.parse(source.read_text(encoding="utf-8"))) or ""
    return re.split(r"(?<=\.)\s", " ".join(words.split("\n\n")[0].split()))[0]


def _path(room: str) -> Path:
    folder = ROOT / PACKAGE / room
    return folder if folder.is_dir() else folder.with_suffix(".py")


def _name(module: str) -> str:
    return module.removeprefix(f"{PACKAGE}.")


def _id(room: str) -> str:
    return room.strip("_")
