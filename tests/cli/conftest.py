"""Fixtures that call the command line as a person does."""

import contextlib
import io
import json
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from mpucal.__main__ import run
from mpucal.chip.access import SessionEvent
from mpucal.files.capture_writer import CaptureWriter
from mpucal.files.messages import BUS, PACKETS
from mpucal.mavlink import MAVLINK_VERSION
from mpucal.mavlink.tlog import RawPacket
from tools.processes import quick


@pytest.fixture(scope="session")
def write_capture():
    """Return a function that writes a capture of these records, and returns its path."""

    def call(path, meta, records):
        with CaptureWriter(path) as writer:
            writer.start(meta, PACKETS if meta.get("driver") == MAVLINK_VERSION else BUS)
            for record in records:
                if isinstance(record, SessionEvent):
                    writer.event(record.name, record.t_ns, record.data)
                elif isinstance(record, RawPacket):
                    writer.packet(*record)
                else:
                    writer.transaction(record)
        return path

    return call


def called(folder, *words):
    """Run a command in a folder, whose result.json then holds what it said."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run(list(words))
    (folder / "result.json").write_text(json.dumps({"code": code, "out": out.getvalue(), "err": err.getvalue()}))


@pytest.fixture(scope="session")
def session(once):
    """Return a whole session on the simulated chip; tests must not change its folder."""
    words = ("session", "--bus", "sim", "--seed", "3", "--rate", "100", "-o", "board")
    folder = once("cli-session", lambda folder: called(folder, *words))
    result = SimpleNamespace(**json.loads((folder / "result.json").read_text()))
    return SimpleNamespace(folder=folder / "board", result=result)


@pytest.fixture(scope="session")
def flown(once):
    """Return a session on the simulated vehicle, which writes to it."""
    words = "session --mavlink sim:imus=1 --rate 50 --target quick -o flown --json --yes"

    def make(folder):
        with quick():
            called(folder, *words.split())

    folder = once("cli-flown", make)
    return SimpleNamespace(folder=folder / "flown", **json.loads((folder / "result.json").read_text()))


@pytest.fixture
def spoilt(session, tmp_path):
    """Write the session's calibration with a number changed, whose digest does not match; return its path."""
    document = json.loads((session.folder / "calibration.json").read_text())
    document["accelerometer"]["b_a"][0] += 1e-9
    path = tmp_path / "spoilt.json"
    path.write_text(json.dumps(document))
    return path


# Time that a busy machine may need for a step of a second or two.
PATIENCE_S = 300.0


@pytest.fixture(scope="session")
def stopped_at():
    """Return a function that runs held.py, sends its session a signal while it is held, and waits for its end."""

    def call(folder: Path, held, sign, *words):
        said, began_s = folder / "said.txt", time.monotonic()
        program = [sys.executable, Path(__file__).with_name("held.py"), *map(str, held)]
        with (
            said.open("w") as stderr,
            subprocess.Popen([*program, *words], cwd=folder, stderr=stderr, stdout=subprocess.DEVNULL) as process,
        ):
            try:
                while not (folder / "held").exists():
                    assert process.poll() is None, said.read_text()
                    assert time.monotonic() < began_s + PATIENCE_S, said.read_text()
                    time.sleep(0.01)
                process.send_signal(sign)
                (folder / "go").touch()
                process.wait(PATIENCE_S)
            finally:
                process.kill()
        for name in ("held", "go"):
            (folder / name).unlink()
        return SimpleNamespace(code=process.returncode, out="", err=said.read_text())

    return call
