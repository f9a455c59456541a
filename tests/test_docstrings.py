"""Docstrings as CONTRIBUTING.md asks for: a verb or a noun first, and a short first sentence."""

import ast
import re
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[1]
FOLDERS = ("mpucal", "tests", "tools")
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
LONGEST = 150
# Questions, and words that point to something the reader has not read.
RIDDLES = {
    *("What", "Whatever", "Whether", "How", "Who", "Whoever", "Which", "Why", "Where", "When", "Likewise", "Same"),
    *("Of", "By", "From", "With", "Without", "Before", "After", "Until", "Unless", "While", "So", "As", "In", "At"),
    *("On", "To", "For", "Through", "If", "Because", "Than", "Beside", "Besides", "And", "But", "Or", "Only", "Also"),
    *("That", "Those", "These", "This", "It", "Its", "They", "Their", "Both", "All", "One", "Another", "Other", "Such"),
    *("Nothing", "Nobody", "None", "Neither", "Not", "No", "Again", "Let"),
}
# Of a test's name: it begins with what is tested.
RIDDLES_OF_TESTS = ("what", "whatever", "who", "whose", "why", "how", "it", "its", "they", "of", "nobody", "nothing")
# Names that did not say what they name.
RETIRED_NAMES = {
    *("Apart", "Bench", "Beside", "Choose", "Flips", "Here", "Looked", "LookedClock", "Questions", "Tally", "Tells"),
    *("Through", "Walk", "Way", "What", "as_seen", "doubt", "found", "meant", "read_away", "said_of_us", "saw"),
    *("steady", "tellable", "telling", "tells", "told", "weigh"),
}


def is_wrong(text):
    """Return True for a docstring that does not begin with a verb or a noun, or whose first sentence is long."""
    sentence = re.split(r"(?<=[.:;]) ", text.split("\n\n")[0].replace("\n", " "))[0]
    return re.split(r"\W", text)[0] in RIDDLES or text.startswith("The same") or len(sentence) > LONGEST


def definitions(node):
    """Yield a node and those that it holds, statements only: expressions define nothing."""
    yield node
    for name in ("body", "orelse", "handlers", "finalbody"):
        for inner in getattr(node, name, ()):
            yield from definitions(inner)


@pytest.mark.parametrize("folder", FOLDERS)
def test_docstrings_and_names_begin_with_what_they_name(folder):
    wrong = []
    for path in (PROJECT / folder).rglob("*.py"):
        for node in definitions(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, DOCUMENTED):
                continue
            where = f"{path.relative_to(PROJECT)}:{getattr(node, 'lineno', 1)}"
            if (text := ast.get_docstring(node)) and is_wrong(text):
                wrong.append(f"{where}: {text[:80]}")
            if getattr(node, "name", "").startswith(tuple(f"test_{word}_" for word in RIDDLES_OF_TESTS)):
                wrong.append(f"{where}: {node.name}")
            if folder == "mpucal" and getattr(node, "name", "") in RETIRED_NAMES:
                wrong.append(f"{where}: {node.name}")
    assert wrong == []
