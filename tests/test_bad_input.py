"""Bad input through the installed command: an exit code, one sentence, and nothing that was measured is lost."""

import errno
import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import smbus2

from mpucal.chip.driver import Driver
from mpucal.cli import session as command
from mpucal.files.mcap import read_capture
from mpucal.session import results as sink
from mpucal.session.lay_flat import LayFlat
from mpucal.session.rotate import Rotate
from mpucal.sources import host_bus

INSTALLED = Path(sys.executable).parent / "mpucal"


@pytest.fixture
def mpucal(mpucal):
    """Call it here, in an empty folder: exit code and what it said."""

    def call(*words):
        done = mpucal(*words)
        assert "Traceback" not in done.err
        return done.code, done.err

    return call


def failing(number):
    def fail(*_):
        raise OSError(number, os.strerror(number))

    return fail


# errors of the kernel on opening a bus or selecting a chip, and the sentence that a user reads
BUSES = {
    "no permission": (False, errno.EACCES, "no permission to use /dev/i2c-1: add yourself to its group"),
    "no adapter": (False, errno.ENXIO, "the I2C bus /dev/i2c-1 is gone: plug it in"),
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
    monkeypatch.setattr(host_bus, "Path", lambda _: Path(os.devnull))
    code, said = mpucal("session", "--bus", "/dev/i2c-1")
    assert code == 3
    assert said.startswith(f"mpucal: {sentence}")
    assert len(said.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


# Options that contradict each other or name nothing, and a part of the message.
WRONG = """
session --bus sim --gravity -9.81                   | '-9.81' is not a local gravity
session --bus sim --gravity nan                     | 'nan' is not a local gravity
session --bus sim --gravity 981                     | In cm/s^2 it is `mpucal session --bus sim --gravity 9.81`.
session --bus sim --gravity 1                       | `mpucal session --bus sim --gravity 9.80665`. To use
calibrate walk.npz --gravity much                   | 'much' is not a local gravity
session --bus sim --address 0x68                    | --bus sim does not take --address
session --bus sim --rate 3                          | use 3.90625 Hz
record --bus sim --dlpf 7                           | --dlpf
record --bus sim --seconds 0                        | --seconds
record --mavlink sim --rate 5000                    | 5000
stream --bus sim --seconds nan                      | 'nan' is not a finite number
stream --replay capture.mcap --apply c.json         | mpucal apply
doctor --bus sim --seconds inf                      | 'inf' is not a finite number
doctor --replay capture.mcap                        | --replay
record                                              | no source was given: give exactly one of --bus BUS,
doctor --bus ''                                     | no bus was named
sesion --bus sim                                    | did you mean session?
session --bus simm                                  | did you mean sim?
session --bus sim:hnd=guided                        | did you mean hand?
session --mavlink sim:hand=gided                    | did you mean guided?
session --mavlink sim --accel-range 8               | --mavlink sim does not take --accel-range
session --mavlink nonsense                          | cannot be understood
session --mavlink sim --signing-key nothing         | cannot be read
session --bus sim --replay x.mcap                   | --bus and --replay were given together
session --replay x.mcap --rate 100                  | --replay does not take --rate, which the capture fixes
session --bus /dev/i2c-99 --seed 1                  | --bus does not take --seed
session --bus sim --tilt-only --model hand          | --tilt-only does not take --model hand
session --bus sim --to diary                        | 'chip'
session --bus sim --page host:70000                 | is not an address for a page
session --bus sim --page 8000                       | is not an address for a page
session --serial                                    | no serial port was named
session --resume nowhere                            | nowhere does not hold a session
session --resume x --bus sim                        | --resume does not take --bus
session --resume x -o y                             | --resume does not take -o
write c.json diary --bus sim                        | 'chip'
write c.json bridge --mavlink sim                   | --mavlink sim has no bridge
write c.json bridge --bus sim                       | give --serial PORT
show                                                | neither a file nor a source was given: give a file
show x.json --bus sim                               | a file and --bus were given together
show --serial                                       | no serial port was named
show --bus sim --columns t,ax,ay,az,gx,gy,gz        | --columns say how a file is read, and a device was given
check c.json                                        | neither a file nor a source was given
check c.json walk.npz --bus sim                     | a file and --bus were given together
check c.json walk.npz --to chip                     | --to was given without -o and a source
noise                                               | neither a file nor a source was given
noise lying.npz --bus sim                           | a file and --bus were given together
firmware                                            | takes one of -o DIR and --flash PORT
firmware -o x --flash y                             | takes one of -o DIR and --flash PORT
"""


def test_contradictory_options_are_exit_code_2_before_anything_is_measured(mpucal, tmp_path):
    for line in WRONG.strip().splitlines():
        words, _, sentence = line.partition("|")
        code, said = mpucal(*shlex.split(words))
        assert (code, sentence.strip() in " ".join(said.split())) == (2, True), (words, said)
    assert list(tmp_path.iterdir()) == []


def test_files_that_cannot_be_read_are_exit_code_3_and_a_sentence(mpucal, tmp_path):
    for name in ("text.mcap", "text.npz", "text.docx", "c.bin"):
        (tmp_path / name).write_text("hello")
    (tmp_path / "c.json").write_text('{"format": "other"}')
    (tmp_path / "empty").mkdir()
    for verb in ("calibrate", "show"):
        for name in ("nothing", "nothing.npz", "nothing.mcap", "nothing/there.csv"):
            assert mpucal(verb, name) == (3, f"mpucal: there is no file {name}: check the path.\n")
        for name, sentence in (("text.mcap", "text.mcap is not an MCAP file"), ("empty", "capture.mcap")):
            code, said = mpucal(verb, name)
            assert (code, sentence in said) == (3, True)
        for name in ("text.npz", "text.docx", "c.bin", "c.json"):
            code, said = mpucal(verb, name)
            assert (code, name in said) == (3, True)
    assert mpucal("session", "--bus", "sim", "-o", "text.mcap/results")[0] == 3
    code, said = mpucal("session", "--serial", "/dev/there-is-none")
    assert (code, "there is no serial port /dev/there-is-none" in said) == (3, True)


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


@pytest.mark.parametrize(
    ("owner", "name", "times"), [(*of, 1 + i % 2) for i, of in enumerate(STATES.values())], ids=STATES.keys()
)
@pytest.mark.usefixtures("uncollected")
def test_ctrl_c_is_exit_code_4_and_the_capture_stays_whole(mpucal, walk, tmp_path, monkeypatch, owner, name, times):
    monkeypatch.setattr(owner, name, interrupted(times, getattr(owner, name)))
    code, said = mpucal("session", "--replay", walk, "-o", "board")
    assert code == 4
    assert said.splitlines()[-1].startswith(("mpucal: the session was interrupted", "mpucal: interrupted"))
    capture = tmp_path / "board" / "capture.mcap"
    if capture.exists():
        assert read_capture(capture).recovered is None
    assert capture.exists()
    if name == "add":
        again = mpucal("session", "--replay", capture, "-o", "again")
        assert (again[0], "the session was interrupted" in again[1]) == (4, times == 1)


def test_a_full_disk_is_exit_code_3_and_keeps_what_was_recorded(mpucal, walk, tmp_path, monkeypatch):
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
