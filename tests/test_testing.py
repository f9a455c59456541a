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
CAPTURES = PROJECT / "fixtures" / "sessions"


@pytest.fixture
def project(tmp_path, capsys):
    (tmp_path / "conftest.py").write_text(PYTHON[0])
    for i, program in enumerate(PYTHON[1:]):
        (tmp_path / f"test_{i}.py").write_text(program)
    folder = tmp_path / "captures" / "board7"
    run(["session", "--replay", str(CAPTURES / "mpu6500.mcap"), "--yes", "--no-write", "-o", str(folder)])
    capsys.readouterr()
    return folder


def tried(folder):
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", folder.parents[1]]
    done = subprocess.run(words, capture_output=True, text=True, check=False, cwd=folder.parents[1])
    return done.returncode, done.stdout


def test_the_page_holds_and_a_calibration_that_moved_fails(project):
    assert tried(project)[0] == 0
    document = json.loads((project / DOCUMENT.name).read_text())
    document["accelerometer"]["b_a"][1] += 1e-7
    (project / DOCUMENT.name).write_text(json.dumps(document))
    code, said = tried(project)
    assert code == 1
    assert "captures/board7: b_a is not what it was" in said
    # one call has a tolerance of 1e-6
    assert "2 failed, 1 passed" in said


def test_a_capture_that_does_not_replay_fails_with_its_sentence(project):
    (project.parents[1] / "test_2.py").unlink()
    shutil.copy(CAPTURES / "enter.mcap", project / CAPTURE.name)
    data = (project / CAPTURE.name).read_bytes()
    (project / CAPTURE.name).write_bytes(data[: len(data) // 50])
    code, said = tried(project)
    assert code == 1
    assert re.search(r"capture.mcap does not replay: mpucal: \w", said)


def test_the_workflow_can_be_read():
    (text,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    (job,) = yaml.safe_load(text)["jobs"].values()
    assert [step["run"] for step in job["steps"] if "run" in step] == ["pip install mpucal pytest", "pytest"]
