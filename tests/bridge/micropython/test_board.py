"""The bridge that is pasted, run by this Python on an emulated line: and its faults."""

import json
from pathlib import Path

import pytest

from mpucal.bridge import board as program
from mpucal.bridge import messages as wire
from mpucal.bridge.bus import BridgeBus
from mpucal.bridge.frame import Deframer, Frame
from mpucal.bridge.messages import Status
from mpucal.bridge.micropython import MicroPythonPort
from mpucal.calibration import calibrate
from mpucal.chip.config import Config
from mpucal.cli.running import open_runner
from mpucal.session.plan import Plan
from mpucal.simulated.chip import open_simulated
from mpucal.simulated.chip.bus import FastClock
from mpucal.sources.chip import OpenedChip
from mpucal.terminal.console import console

BLOB = (Path(__file__).parents[3] / "fixtures" / "vectors" / "blob_measured.bin").read_bytes()


class I2c:
    """machine.I2C, with `chip` on it."""

    def __init__(self, chip, failure=None):
        self.chip, self.failure = chip, failure

    def readfrom(self, address, count):
        if address != 0x68 or self.failure == "nobody":
            raise OSError(5)
        return bytes(count)

    def readfrom_mem(self, address, register, count):
        self._fail()
        return self.chip.read(register, count).data

    def writeto_mem(self, address, register, data):
        self._fail()
        self.chip.write(register, data)

    def _fail(self):
        if self.failure:
            raise OSError(110 if self.failure == "held low" else 5)


@pytest.fixture
def pasted(tmp_path):
    def make(chip, now_ns):
        return program.Bridge([I2c(chip)], lambda: now_ns() // 1000 % 2**30, f"{tmp_path}/")

    return make


def said(bridge, data):
    bridge.receive(data)
    return list(Deframer().feed(bridge.work()))


def ask(bridge, request):
    (frame,) = said(bridge, Frame(request.TYPE, 1, request.payload()).encode())
    return wire.answer_of(frame.type, frame.payload)


def simulated(**how):
    clock = FastClock()
    chip = open_simulated("sim:noise=1", seed=3, clock=clock)
    return chip, clock


@pytest.mark.parametrize(
    ("failure", "status"),
    [("nobody", Status.NO_ANSWER), ("held low", Status.BUS_FAILED), ("broke off", Status.BUS_FAILED)],
)
def test_a_transfer_that_failed_says_how(failure, status, pasted):
    chip, clock = simulated()
    bridge = pasted(chip, clock.now)
    ask(bridge, wire.Hello())
    bridge.chip.i2c.failure = failure
    assert [ask(bridge, wire.Read(0x75, 1)).status, ask(bridge, wire.Burst(0x74, 99)).status] == [status, status]


def test_a_write_that_power_cuts_leaves_the_old_blob(pasted, tmp_path):
    bridge = pasted(None, lambda: 0)
    for blob in (BLOB, BLOB):
        bridge.files.begun = bytearray(blob)
        bridge.files.commit()
    used, generation, _ = bridge.files.stored()
    assert generation == 2
    whole = Path(bridge.files.paths[used]).read_bytes()
    for cut in range(len(whole)):
        Path(bridge.files.paths[used]).write_bytes(whole[:cut])
        assert bridge.files.stored() == (1 - used, 1, BLOB)


def session(bus, chip, folder):
    """A session on `bus` behind which `chip` is held by its hand; its verdict."""
    opened = OpenedChip(bus, Plan(Config(rate_hz=50), target="quick"), (chip.hear,), real_time=False)
    with open_runner(opened, folder / "capture.mcap", console(quiet=True)) as runner:
        recording = runner.measure()
        return runner.calibrate(recording, calibrate)


@pytest.mark.slow
def test_a_whole_session_on_micropython_is_good(board, tmp_path):
    chip, clock = simulated()
    found = session(BridgeBus(MicroPythonPort(board(chip, clock))), chip, tmp_path)
    assert found.verdict == "good", json.dumps(found.quality["reasons"])
