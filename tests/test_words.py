"""Terms that a user reads are those of docs/glossary.md, and retired words do not return."""

import ast
import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from mpucal.__main__ import run
from mpucal.cli import COMMANDS, commands
from mpucal.session.aims import AIMS
from mpucal.session.events import Knowledge, Prompt, PromptKind
from mpucal.terminal.layout import lines
from mpucal.terminal.letters import UNICODE
from mpucal.terminal.view import View

PROJECT = Path(__file__).parents[1]
PAGES = [PROJECT / "README.md", *sorted((PROJECT / "docs").glob("*.md"))]
CAPTURE = PROJECT / "fixtures" / "sessions" / "enter.mcap"

# retired word: its replacement
RETIRED = {
    r"(?<!kalman )\bgains?\b": "scale factor, scale factor error",
    r"\bleans?\b( \w+)? to\b": "misalignment x->y",
    r"\boff by\b": "error",
    r"\bpromise[sd]?\b": "predicted, standard uncertainty",
    r"\bclaim(s|ed)?\b": "predicted, standard uncertainty",
    r"\bknows?\b( \w+)? (better|nothing)\b|\bhow well to know\b": "required accuracy; provisional",
    r"\baslant\b": "tilted",
    r"\bfast on (its|the) board\b": "firmly fixed to the board",
    r"\bholds? what it held\b|\bheld what it held\b": "nothing was changed",
    r"\bdoes not tell\b|\bnot to be told\b": "not observable; undecided",
}


def retired(text):
    """The words of RETIRED in a text, each with what stands around it."""
    flat = " ".join(text.split())
    return [
        f"{flat[max(found.start() - 40, 0) : found.end() + 20]!r}: say {instead}"
        for words, instead in RETIRED.items()
        for found in re.finditer(words, flat, re.IGNORECASE)
    ]


def test_pages_use_no_retired_word():
    found = {page.name: words for page in PAGES if (words := retired(page.read_text(encoding="utf-8")))}
    assert found == {}


def test_help_uses_no_retired_word():
    for words in ([], *([name] for name in COMMANDS)):
        shown = CliRunner().invoke(commands, [*words, "--help"])
        assert (shown.exit_code, retired(shown.output)) == (0, []), words


def texts(module):
    """The strings of a module that read as words, but for its docstrings."""
    tree = ast.parse(module.read_text(encoding="utf-8"))
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef)
    docstrings = {id(n.body[0].value) for n in ast.walk(tree) if isinstance(n, documented) and ast.get_docstring(n)}
    strings = (n for n in ast.walk(tree) if isinstance(n, ast.Constant) and isinstance(n.value, str))
    return [n.value for n in strings if " " in n.value and id(n) not in docstrings]


def test_messages_use_no_retired_word():
    modules = [m for m in (PROJECT / "mpucal").rglob("*.py") if retired(m.read_text(encoding="utf-8"))]
    assert {m.name: words for m in modules if (words := retired("\n".join(texts(m))))} == {}


def test_the_screen_uses_no_retired_word():
    view = View("mpucal").after(Prompt(PromptKind.ROTATE, "Turn the board: on its right edge (+X).", (1.0, 0.0, 0.0)))
    three = (0.5, 0.5, 0.5)
    view = view.after(Knowledge(0.0, three, three, three, AIMS["normal"].target, three, three, three, 0.5, None, ""))
    drawn = "\n".join(line.plain for line in lines(view, 160, 50, UNICODE))
    assert "scale factor error" in drawn
    assert "misalignment" in drawn
    assert retired(drawn) == []


@pytest.mark.slow
def test_a_session_its_summary_and_its_report_use_no_retired_word(tmp_path, capsys):
    assert run(["session", "--replay", str(CAPTURE), "-o", str(tmp_path)]) == 0
    said = capsys.readouterr()
    assert "CHECK" in said.err
    for text in (said.err, said.out, (tmp_path / "report.html").read_text(encoding="utf-8")):
        assert retired(text) == []
