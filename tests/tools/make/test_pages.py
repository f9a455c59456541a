"""The pages and drawings of docs/ agree with the tables and imports, and the names in them exist."""

import ast
import re
from pathlib import Path

from tools.make import drawings, pages

ROOT = Path(__file__).parents[3]
DOCUMENT = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
REFERENCES = {(path, name) for path, name in re.findall(r"`([\w/]+\.(?:py|[ch]pp|md))(?::\s+([\w.]+))?`", DOCUMENT)}


def test_an_arrow_that_a_longer_way_implies_is_left_out():
    imports = {"top": {"middle", "bottom"}, "middle": {"bottom"}, "bottom": set()}
    assert drawings.floors(imports) == ["bottom", "middle", "top"]
    assert drawings.reduced(imports) == {"top": {"middle"}, "middle": {"bottom"}, "bottom": set()}


def defined(tree, name):
    """Return True if a module defines, or imports, a name such as Class.method."""
    first, *rest = name.split(".")
    for node in tree.body:
        names = {getattr(node, "name", None)}
        if isinstance(node, ast.Assign | ast.AnnAssign):
            names = {ast.unparse(target) for target in getattr(node, "targets", None) or [node.target]}
        if first in names:
            return not rest or defined(node, ".".join(rest))
    return False


def test_references_of_the_documentation_exist():
    for path, name in sorted(REFERENCES):
        found = next((folder / path for folder in (ROOT / "mpucal", ROOT) if (folder / path).exists()), None)
        assert found is not None, path
        assert not name or defined(ast.parse(found.read_text(encoding="utf-8")), name), (path, name)


def test_the_tests_and_tools_that_a_page_names_are_there():
    pages = {path: path.read_text(encoding="utf-8") for path in (ROOT / "docs").rglob("*.md")}
    named = {
        (page.name, path) for page, text in pages.items() for path in re.findall(r"`((?:tests|tools)/[\w/.]+)`", text)
    }
    assert len(named) > 20
    assert [each for each in sorted(named) if not (ROOT / each[1]).exists()] == []


def test_generated_files_are_up_to_date():
    assert not list(pages.outdated()), "run `python -m tools.make pages`"
