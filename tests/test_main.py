"""Ctrl-C before the program handles it."""

import subprocess
import sys

import pytest

KEPT = "; the recording until then is kept"

PROGRAM = """
import sys

class CtrlC:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            exec("raise KeyboardInterrupt")  # as dataclasses do, which CPython remembers

sys.meta_path.insert(0, CtrlC())
from mpucal.__main__ import main
main({words!r})
"""


@pytest.mark.parametrize("module", ["click", "numpy", "mpucal.session.runner"])
def test_ctrl_c_while_python_imports_is_one_sentence(tmp_path, module):
    done = interrupted(module, ["session", "--bus", "sim", "-o", str(tmp_path / "board")])
    assert done.stderr.lstrip() == f"mpucal: interrupted{KEPT}.\n"
    assert done.returncode == 4
    assert list(tmp_path.iterdir()) == []


def test_an_interrupted_command_without_a_recording_keeps_nothing(tmp_path):
    done = interrupted("mpucal.cli.apply", ["apply", "calibration.json", "walk.csv", "-o", str(tmp_path / "out.csv")])
    assert done.stderr.lstrip() == "mpucal: interrupted.\n"
    assert done.returncode == 4


def interrupted(module, words):
    """A command that is interrupted where it first imports a module."""
    program = PROGRAM.format(module=module, words=words)
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)


@pytest.mark.parametrize("stderr", ["2>/dev/full", "2>&-"])
def test_an_unwritable_stderr_changes_no_exit_code(stderr):
    words = f"{sys.executable} -m mpucal show nothing.json {stderr}"
    assert subprocess.run(words, shell=True, check=False).returncode == 3
