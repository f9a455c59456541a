"""mpucal's fixture for other projects' tests, as docs/captures-in-ci.md has it: in a project of its own."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from mpucal.__main__ import run
from mpucal.result.session_files import CAPTURE, DOCUMENT

PROJECT = Path(__file__).parents[1]
PAGE = (PROJECT / "docs" / "captures-in-ci.md").read_text(encoding="utf-8")
PYTHON = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


@pytest.fixture
def captures(walk, tmp_path, capsys):
    """The page's project, with the session of one board: a short one, since it is replayed five times."""
    (tmp_path / "conftest.py").write_text(PYTHON[0])
    for i, program in enumerate(PYTHON[1:]):
        (tmp_path / f"test_{i}.py").write_text(program)
    folder = tmp_path / "captures"
    run(["session", "--replay", str(walk), "--yes", "--no-write", "-o", str(folder / "board7")])
    capsys.readouterr()
    return folder


def test_the_page_holds_and_what_moved_or_does_not_replay_fails_with_its_sentence(captures):
    for name in ("board8", "board9"):
        shutil.copytree(captures / "board7", captures / name)
    moved = json.loads((captures / "board7" / DOCUMENT.name).read_text())
    moved["accelerometer"]["b_a"][1] += 1e-7
    (captures / "board7" / DOCUMENT.name).write_text(json.dumps(moved))
    cut = captures / "board9" / CAPTURE.name
    cut.write_bytes(cut.read_bytes()[: cut.stat().st_size // 50])
    # what the page has of one that moved, of one that did not, too
    (captures.parent / "test_right.py").write_text(PYTHON[3].replace("board7", "board8"))

    words = [sys.executable, "-m", "pytest", "-q", "-rA", "-p", "no:cacheprovider", captures.parent]
    done = subprocess.run(words, capture_output=True, text=True, check=False, cwd=captures.parent)
    ended = re.findall(r"^(PASSED|FAILED) test_(\w+)\.py::\w+(\[\w+\])?", done.stdout, re.MULTILINE)
    assert done.returncode == 1
    assert sorted(ended) == [
        ("FAILED", "0", "[board7]"),
        ("FAILED", "0", "[board9]"),
        ("FAILED", "2", ""),
        ("PASSED", "0", "[board8]"),
        ("PASSED", "1", ""),  # with a tolerance of 1e-6
        ("PASSED", "right", ""),
    ]
    assert "captures/board7: b_a has changed" in done.stdout
    assert re.search(r"board9 does not replay: mpucal: \w", done.stdout)


def test_the_workflow_can_be_read():
    (text,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    (job,) = yaml.safe_load(text)["jobs"].values()
    assert [step["run"] for step in job["steps"] if "run" in step] == ["pip install mpucal pytest", "pytest"]
