import errno
import io
import re
import shlex
import subprocess
import sys

import click
import numpy as np
import pytest

from mpucal.cli import COMMANDS, commands
from mpucal.result.calibration import Calibration

HEAVY = ("numpy", "rich")
DEVICES = ("mcap", "pymavlink", "smbus2", "serial", "scipy", "matplotlib", "mpucal.iio.driver", "mpucal.mavlink.link")


def test_no_help_loads_what_is_heavy_or_reads_captures_or_devices():
    program = f"""if True:
        import sys
        from mpucal.__main__ import run
        from mpucal.cli import COMMANDS, commands
        print(run(["--help"]), [name for name in {HEAVY!r} if name in sys.modules], file=sys.stderr)
        [run([name, "--help"]) for name in COMMANDS]
        print([name for name in {DEVICES!r} if name in sys.modules], file=sys.stderr)
    """
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stderr.split("\n") == ["0 []", "[]", ""]
    assert all(name in done.stdout for name in COMMANDS)


def test_each_command_has_help_with_an_example_that_is_understood(mpucal):
    assert mpucal("help").out == mpucal("--help").out
    for name in COMMANDS:
        result = mpucal("help", name)
        assert (result.code, result.out) == (0, mpucal(name, "--help").out)
        examples = re.findall(r"`mpucal ([^`]+)`", commands.get_command(click.Context(commands), name).epilog)
        assert f"Example: `mpucal {name}" in " ".join(result.out.split())
        for words in map(shlex.split, examples):
            assert commands.get_command(None, words[0]).make_context(words[0], words[1:]).command.name == words[0]


def test_a_misspelt_command_has_no_help(mpucal):
    result = mpucal("help", "sesion", code=2)
    assert "did you mean session?" in result.err


def test_the_shell_completes_commands_and_options(mpucal, monkeypatch):
    monkeypatch.setenv("_MPUCAL_COMPLETE", "bash_complete")
    for typed, completed in (("mpucal se", "session"), ("mpucal session --ta", "--target")):
        monkeypatch.setenv("COMP_WORDS", typed)
        monkeypatch.setenv("COMP_CWORD", str(len(typed.split()) - 1))
        assert mpucal().out == f"plain,{completed}\n"


def test_wrong_usage_is_exit_code_2(mpucal):
    for words in ("--nonsense", "nonsense", "calibrate", "session --rate fast"):
        result = mpucal(*words.split())
        assert result.code == 2 and "Error" in result.err


def test_the_unexpected_is_a_bug_with_a_trace(mpucal, monkeypatch):
    monkeypatch.setattr("mpucal.cli.show.load", lambda *_: 1 / 0)
    result = mpucal("show", "some.npz", code=1)
    assert "ZeroDivisionError" in result.err
    assert "this is a bug in mpucal" in result.err


def test_a_full_disk_behind_stdout_is_exit_code_3(mpucal, tmp_path, monkeypatch):
    class Full(io.StringIO):
        def write(self, _text):
            raise OSError(errno.ENOSPC, "No space left on device")

    Calibration(np.eye(3), np.zeros(3)).save("c.json")
    monkeypatch.setattr(sys, "stdout", Full())
    result = mpucal("show", "c.json", code=3)
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
    result = mpucal("show", "some.npz", code=3)
    assert result.err.startswith(f"mpucal: {said}")
    assert result.err.count("\n") == 1
