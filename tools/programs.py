"""The programs of a folder of tools/, each a module with `main`: listed by their docstrings, run by name."""

from __future__ import annotations

import ast
import os
import sys
from importlib import import_module
from pathlib import Path

from mpucal.session.threads import ONE_THREAD


def run(folder: str) -> None:
    """Run the program of `folder` that the command line names, or list them.

    Raises:
        SystemExit: by the program; with a sentence where there is none of that name.
    """
    # as mpucal does, before NumPy loads
    os.environ.update(ONE_THREAD)
    programs = {path.stem: path for path in sorted((Path(__file__).parent / folder).glob("*.py")) if _runs(path)}
    match sys.argv[1:]:
        case [name, *arguments] if name in programs:
            sys.argv = [f"python -m tools.{folder} {name}", *arguments]
            sys.exit(import_module(f"tools.{folder}.{name}").main())
        case [name, *_] if not name.startswith("-"):
            sys.exit(f"tools.{folder} has no program {name!r}; `python -m tools.{folder}` lists them")
        case _:
            for name, path in programs.items():
                print(f"{name:18} {(ast.get_docstring(ast.parse(path.read_text())) or '').splitlines()[0]}")


def _runs(path: Path) -> bool:
    return any(text in path.read_text(encoding="utf-8") for text in ("\ndef main(", "\nmain = "))
