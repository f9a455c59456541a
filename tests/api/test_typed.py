"""Programs that use mpucal, checked by mypy and basedpyright (pyright), both strict."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import mpucal

PROJECT = Path(__file__).parents[2]
PROGRAMS = Path(__file__).parent / "typed"
WRONG = PROGRAMS / "wrong.py"
MARKED = {i for i, line in enumerate(WRONG.read_text().splitlines(), 1) if line.endswith("# wrong")}


def by_mypy(tmp_path):
    words = [sys.executable, "-m", "mypy", "--strict", *map(str, sorted(PROGRAMS.glob("*.py")))]
    done = subprocess.run(words, capture_output=True, text=True, check=False, cwd=PROJECT)
    return {
        (Path(name).name, int(line)) for name, line in re.findall(r"^(.*?):(\d+): error", done.stdout, re.MULTILINE)
    }


def by_pyright(tmp_path):
    settings = tmp_path / "pyrightconfig.json"
    settings.write_text(json.dumps({"include": [str(PROGRAMS)], "typeCheckingMode": "strict"}))
    words = [sys.executable, "-m", "basedpyright", "-p", str(settings), "--pythonpath", sys.executable, "--outputjson"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    found = json.loads(done.stdout)["generalDiagnostics"]
    return {(Path(each["file"]).name, each["range"]["start"]["line"] + 1) for each in found}


def test_each_public_name_is_used():
    text = (PROGRAMS / "whole_api.py").read_text()
    assert [name for name in mpucal.__all__ if not re.search(rf"\b{name}\b", text)] == []


@pytest.mark.parametrize(
    ("name", "checker"), [("mypy", by_mypy), pytest.param("basedpyright", by_pyright, marks=pytest.mark.slow)]
)
def test_type_checkers_report_exactly_the_wrong_lines(name, checker, tmp_path):
    for needed in (name, "matplotlib", "polars"):
        pytest.importorskip(needed)
    assert checker(tmp_path) == {(WRONG.name, line) for line in MARKED}
