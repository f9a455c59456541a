"""Write the stubs of the compiled modules by nanobind's stubgen, from the signatures that they carry.

python -m tools.make stubs
"""

import re
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

from nanobind.stubgen import StubGen

ROOT = Path(__file__).parents[2]
HEAD = '"""Made by tools/make/stubs.py from the compiled module; its functions say what they do."""\n'
COMPILED = (
    "mpucal.kernel._kernel",
    "mpucal.files._text",
    "mpucal.files._packed",
    "mpucal.chip._flips",
)
# order and device of an array are checked at run time, and type checkers know neither
DETAILS = re.compile(r"Annotated\[(NDArray\[[\w.]+\]), dict\((?:[^()]|\([^)]*\))*\)\]")


def stubs() -> Iterator[tuple[Path, str]]:
    """Yield the path and the text of each stub."""
    for name in COMPILED:
        made = StubGen(import_module(name), include_docstrings=False, quiet=True)
        made.put(made.module)
        text = HEAD + DETAILS.sub(r"\1", made.get()).replace("from typing import Annotated\n", "")
        path = ROOT / f"{name.replace('.', '/')}.pyi"
        ruff = [sys.executable, "-m", "ruff", "format", "--stdin-filename", str(path), "-"]
        yield path, subprocess.run(ruff, input=text, capture_output=True, text=True, check=True).stdout


def main() -> None:
    """Write the stubs."""
    for path, text in stubs():
        path.write_text(text, encoding="utf-8")
