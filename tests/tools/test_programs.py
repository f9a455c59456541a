"""The programs of tools/: each loads, says what it is, and is listed."""

import ast
from importlib import import_module
from pathlib import Path

import pytest

from tools import programs

TOOLS = Path(programs.__file__).parent
FOLDERS = ("attack", "bench", "lab", "make")
# they load what an extra of their own brings, replace the compiled modules, or are loaded by mkdocs in test_site.py
APART = {"__main__", "sanitized", "fuzz_kernel", "syscalls", "syscalls_commands", "site_hooks"}


def test_every_program_loads_and_says_what_it_is():
    """Load each program, since no other test starts most of them and a moved module would go unnoticed.

    In one test, so that one of several workers loads them.
    """
    for folder in FOLDERS:
        for path in sorted((TOOLS / folder).glob("*.py")):
            assert path.stem in APART or import_module(f"tools.{folder}.{path.stem}").__doc__, path


@pytest.mark.parametrize("folder", FOLDERS)
def test_a_folder_lists_its_programs(folder, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", [folder])
    programs.run(folder)
    listed = {line.split()[0] for line in capsys.readouterr().out.splitlines()}
    runs = {path.stem for path in (TOOLS / folder).glob("*.py") if _has_main(path)}
    assert listed == runs != set()


def _has_main(path):
    """Return True if there is a `main`: a function, or what makes one of its options."""
    names = [
        (getattr(node, "name", None), *map(ast.unparse, getattr(node, "targets", ())))
        for node in ast.parse(path.read_text()).body
    ]
    return any("main" in each for each in names)


def test_an_unknown_program_is_reported(monkeypatch):
    monkeypatch.setattr("sys.argv", ["lab", "nonsense"])
    with pytest.raises(SystemExit, match="has no program 'nonsense'"):
        programs.run("lab")
