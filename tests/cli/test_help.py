import errno
import io
import subprocess
import sys

import numpy as np
import pytest

from mpucal.cli import COMMANDS
from mpucal.result.calibration import Calibration

HEAVY = ("numpy", "mcap", "smbus2", "rich", "scipy", "matplotlib")


def test_help_loads_nothing_heavy():
    program = (
        "import sys; from mpucal.__main__ import run; code = run(['--help']);"
        f"print(code, [name for name in {HEAVY!r} if name in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == "0 []"
    assert all(name in done.stdout for name in COMMANDS)


def test_the_help_of_no_command_loads_what_reads_captures_or_devices():
    heavy = ("mcap", "pymavlink", "smbus2", "serial", "scipy", "matplotlib", "mpucal.iio.driver", "mpucal.mavlink.link")
    program = (
        "import sys; from mpucal.__main__ import run; from mpucal.cli import COMMANDS;"
        "[run([name, '--help']) for name in COMMANDS];"
        f"print([name for name in {heavy!r} if name in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == "[]"


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_of_each_command_has_an_example(mpucal, name):
    result = mpucal(name, "--help")
    assert result.code == 0
    assert f"Example: `mpucal {name}" in " ".join(result.out.split())


@pytest.mark.parametrize("words", [[], ["session"]], ids=["all", "session"])
def test_help_is_a_command_too(mpucal, words):
    result = mpucal("help", *words)
    assert result.code == 0
    assert result.out == mpucal(*words, "--help").out


def test_a_misspelt_command_has_no_help(mpucal):
    result = mpucal("help", "sesion")
    assert result.code == 2
    assert "did you mean session?" in result.err


def test_the_shell_completes_commands_and_options(mpucal, monkeypatch):
    monkeypatch.setenv("_MPUCAL_COMPLETE", "bash_complete")
    for typed, completed in (("mpucal se", "session"), ("mpucal session --ta", "--target")):
        monkeypatch.setenv("COMP_WORDS", typed)
        monkeypatch.setenv("COMP_CWORD", str(len(typed.split()) - 1))
        assert mpucal().out == f"plain,{completed}\n"


@pytest.mark.parametrize("words", [["--nonsense"], ["nonsense"], ["calibrate"], ["session", "--rate", "fast"]])
def test_wrong_usage_is_2(mpucal, words):
    result = mpucal(*words)
    assert result.code == 2
    assert "Error" in result.err
    assert "Traceback" not in result.err


def test_the_unexpected_is_a_bug_with_a_trace(mpucal, monkeypatch):
    monkeypatch.setattr("mpucal.cli.show.load", lambda *_: 1 / 0)
    result = mpucal("show", "some.npz")
    assert result.code == 1
    assert "ZeroDivisionError" in result.err
    assert "this is a bug in mpucal" in result.err


def test_a_full_disk_behind_stdout_is_3(mpucal, tmp_path, monkeypatch):
    class Full(io.StringIO):
        def write(self, _text):
            raise OSError(errno.ENOSPC, "No space left on device")

    Calibration(np.eye(3), np.zeros(3)).save("c.json")
    monkeypatch.setattr(sys, "stdout", Full())
    result = mpucal("show", "c.json")
    assert result.code == 3
    assert result.err == "mpucal: the output cannot be written (No space left on device): free space there.\n"


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (MemoryError(), "there is not enough memory: end other programs, or give a shorter recording."),
        (PermissionError(errno.EACCES, "Permission denied", "x/c.json"), "cannot use x/c.json (Permission denied)"),
        (OSError(errno.EMFILE, "Too many open files"), "cannot use a file or device (Too many open files)"),
    ],
)
def test_errors_of_the_computer_are_exit_code_3(mpucal, monkeypatch, error, said):
    def refused(*_words):
        raise error

    monkeypatch.setattr("mpucal.cli.show.load", refused)
    result = mpucal("show", "some.npz")
    assert result.code == 3
    assert result.err.startswith(f"mpucal: {said}")
    assert result.err.count("\n") == 1
