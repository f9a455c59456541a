"""Docstrings as CONTRIBUTING.md asks for: a verb or a noun first, a first sentence that is taken in at once."""

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
# Names that did not say what they name.
RETIRED_NAMES = {
    *("Apart", "Bench", "Beside", "Choose", "Flips", "Here", "Looked", "LookedClock", "Questions", "Tally", "Tells"),
    *("Through", "Walk", "Way", "What", "as_seen", "doubt", "found", "meant", "read_away", "said_of_us", "saw"),
    *("steady", "tellable", "telling", "tells", "told", "weigh"),
}


def docstrings(path):
    """Yield (line, docstring) of the module, classes and functions of a file."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, DOCUMENTED) and (text := ast.get_docstring(node)):
            yield getattr(node, "lineno", 1), text


@pytest.mark.parametrize("folder", FOLDERS)
def test_a_docstring_begins_with_a_verb_or_a_noun_and_its_first_sentence_is_short(folder):
    wrong = []
    for path in (PROJECT / folder).rglob("*.py"):
        for line, text in docstrings(path):
            first = text.split("\n\n")[0].replace("\n", " ")
            word = re.split(r"\W", text)[0]
            sentence = re.split(r"(?<=[.:;]) ", first)[0]
            if word in RIDDLES or text.startswith("The same") or len(sentence) > LONGEST:
                wrong.append(f"{path.relative_to(PROJECT)}:{line}: {first[:80]}")
    assert wrong == []


def test_no_retired_name_comes_back():
    wrong = [
        f"{path.relative_to(PROJECT)}:{node.lineno}: {node.name}"
        for path in (PROJECT / "mpucal").rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, DOCUMENTED[1:]) and node.name in RETIRED_NAMES
    ]
    assert wrong == []
