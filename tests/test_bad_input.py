"""Bad input through the installed command: an exit code, one sentence, and nothing that was measured is lost."""

import errno
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import smbus2

from mpucal.__main__ import run
from mpucal.chip.driver import Driver
from mpucal.cli import session as command
from mpucal.files.mcap import read_capture
from mpucal.session import results as sink
from mpucal.session.lay_flat import LayFlat
from mpucal.session.rotate import Rotate
from mpucal.sources import i2c_errors

INSTALLED = Path(sys.executable).parent / "mpucal"


@pytest.fixture
def mpucal(capsys, tmp_path, monkeypatch):
    """Call it here, in an empty folder: exit code and what it said."""
    monkeypatch.chdir(tmp_path)

    def call(*words):
        code = run([str(word) for word in words])
        said = capsys.readouterr().err
        assert "Traceback" not in said
        return code, said

    return call


def failing(number):
    def fail(*_):
        raise OSError(number, os.strerror(number))

    return fail


# what the kernel says where somebody opens a bus, or asks for a chip on it, and what a person is told
BUSES = {
    "no permission": (False, errno.EACCES, "no permission to use /dev/i2c-1: add yourself to its group"),
    "no adapter": (False, errno.ENXIO, "no adapter is behind /dev/i2c-1: plug it in"),
    "a wire held low": (
        True,
        errno.ETIMEDOUT,
        "the I2C bus does not become free (0x68 on /dev/i2c-1): a wire holds SDA",
    ),
}


@pytest.mark.parametrize(("opens", "number", "sentence"), BUSES.values(), ids=BUSES)
def test_a_bus_that_fails_says_why_and_leaves_nothing(mpucal, tmp_path, monkeypatch, opens, number, sentence):
    def open_(smbus, _):
        if not opens:
            failing(number)()
        smbus.fd, smbus.funcs = os.open(os.devnull, os.O_RDWR), smbus2.I2cFunc.I2C

    monkeypatch.setattr(smbus2.SMBus, "open", open_)
    monkeypatch.setattr(smbus2.SMBus, "read_byte_data", failing(number))
    # an adapter that is there, on a machine without one
    monkeypatch.setattr(i2c_errors, "Path", lambda _: Path(os.devnull))
    code, said = mpucal("session", "--bus", "/dev/i2c-1")
    assert code == 3
    assert said.startswith(f"mpucal: {sentence}")
    assert len(said.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["session", "--bus", "sim", "--gravity", "-9.81"], "'-9.81' is not a local gravity"),
        (["session", "--bus", "sim", "--gravity", "nan"], "'nan' is not a local gravity"),
        (["session", "--bus", "sim", "--gravity", "981"], "In cm/s² it is `mpucal session --bus sim --gravity 9.81`."),
        (["session", "--bus", "sim", "--gravity", "1"], "`mpucal session --bus sim --gravity 9.80665`. To use"),
        (["calibrate", "walk.npz", "--gravity", "much"], "'much' is not a local gravity"),
        (["session", "--bus", "sim", "--address", "0x68"], "--bus sim does not take --address"),
        (["session", "--bus", "sim", "--rate", "3"], "use 3.90625 Hz"),
        (["record", "--bus", "sim", "--seconds", "0"], "--seconds"),
        (["stream", "--bus", "sim", "--seconds", "nan"], "'nan' is not a finite number"),
        (["doctor", "--bus", "sim", "--seconds", "inf"], "'inf' is not a finite number"),
        (["record"], "no source was given"),
        (["doctor", "--bus", ""], "no bus was named"),
        (["sesion", "--bus", "sim"], "did you mean session?"),
        (["session", "--bus", "simm"], "did you mean sim?"),
        (["session", "--bus", "sim:hnd=guided"], "did you mean hand?"),
        (["session", "--mavlink", "sim:hand=gided"], "did you mean guided?"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_words_that_cannot_be_meant_are_2_before_anything_is_measured(mpucal, tmp_path, words, sentence):
    code, said = mpucal(*words)
    assert code == 2
    assert sentence in said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["nothing", "nothing.npz", "nothing.mcap", "nothing/there.csv"])
@pytest.mark.parametrize("verb", ["calibrate", "show"])
def test_a_file_that_is_not_there_is_called_that(mpucal, verb, name):
    assert mpucal(verb, name) == (3, f"mpucal: there is no file {name}: check the path.\n")


def interrupted(times, function):
    """`function`, during which somebody presses Ctrl-C so many times."""

    def call(*words, **options):
        for _ in range(times):
            signal.raise_signal(signal.SIGINT)
        return function(*words, **options)

    return call


STATES = {
    "connect": (Driver, "start"),
    "lay flat": (LayFlat, "add"),
    "rotate": (Rotate, "add"),
    "calibrate": (command, "calibrate_vehicle"),
    "write": (sink, "write_together"),
}


@pytest.mark.parametrize(("owner", "name"), STATES.values(), ids=STATES.keys())
@pytest.mark.parametrize("times", [1, 2], ids=["once", "twice"])
@pytest.mark.usefixtures("uncollected")
def test_ctrl_c_is_4_and_the_capture_stays_whole(mpucal, walk, tmp_path, monkeypatch, owner, name, times):
    monkeypatch.setattr(owner, name, interrupted(times, getattr(owner, name)))
    code, said = mpucal("session", "--replay", walk, "-o", "board")
    assert code == 4
    assert said.splitlines()[-1].startswith(("mpucal: the session was interrupted", "mpucal: interrupted"))
    capture = tmp_path / "board" / "capture.mcap"
    if capture.exists():
        assert read_capture(capture).recovered is None
    assert capture.exists() == (name != "start" or times == 1)


def test_a_full_disk_is_3_and_keeps_what_was_recorded(mpucal, walk, tmp_path, monkeypatch):
    def full(files):
        raise sink.OutputError(f"cannot write {min(files)} (No space left on device)", "make room")

    monkeypatch.setattr(sink, "write_together", full)
    code, said = mpucal("session", "--replay", walk, "-o", "board")
    assert code == 3
    assert "The capture is kept in board/capture.mcap.\n" in said
    assert "No space left on device" in said.splitlines()[-1]
    assert read_capture(tmp_path / "board" / "capture.mcap").recovered is None


def test_the_installed_command_gives_the_same_exit_codes(tmp_path):
    (tmp_path / "text.mcap").write_text("hello")
    lines = ((["session", "--bus", "simm"], 2), (["session", "--replay", "text.mcap"], 3), (["--version"], 0))
    for words, code in lines:
        done = subprocess.run([INSTALLED, *words], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == code
        assert len((done.stdout + done.stderr).splitlines()) == 1
