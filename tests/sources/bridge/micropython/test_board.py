"""The bridge that is pasted, run by this Python on an emulated line: its answers are the emulated bridge's."""

import json
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.calibration import calibrate
from mpucal.chip.access import Reply
from mpucal.chip.config import Config
from mpucal.cli.running import open_runner
from mpucal.session.plan import Plan
from mpucal.simulated.bridge import EmulatedBridge, EmulatedLine
from mpucal.simulated.chip import open_simulated
from mpucal.simulated.chip.clock import FastClock
from mpucal.sources.bridge import board as program
from mpucal.sources.bridge import messages as wire
from mpucal.sources.bridge.bus import BridgeBus
from mpucal.sources.bridge.frame import Deframer, Frame
from mpucal.sources.bridge.messages import Status
from mpucal.sources.bridge.micropython import MicroPythonPort
from mpucal.sources.chip import OpenedChip
from mpucal.terminal.console import console

BLOB = (Path(__file__).parents[4] / "fixtures" / "vectors" / "blob_measured.bin").read_bytes()


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


requests = st.lists(
    st.one_of(
        st.builds(Frame, st.sampled_from([*wire.REQUESTS, 0x33]), st.integers(0, 255), st.binary(max_size=66)),
        st.builds(lambda at: Frame(0x13, 1, wire.BlobData(at, BLOB[at : at + 32]).payload()), st.integers(0, 187)),
        st.sampled_from(
            [
                Frame(0x12, 2, wire.BlobBegin(188).payload()),
                Frame(0x14, 3, wire.BlobCommit(188, int.from_bytes(BLOB[-4:], "little")).payload()),
                Frame(0x10, 4),
                Frame(0x05, 5, wire.Stream(14, 2).payload()),
                *(Frame(0x13, 6, wire.BlobData(at, BLOB[at : at + 32]).payload()) for at in range(0, 188, 32)),
            ]
        ),
    ),
    max_size=25,
)


class Registers:
    """A chip of which every register reads as its number, and FIFO_COUNT as 28."""

    def read(self, register, count):
        return Reply(b"\0\x1c" if (register, count) == (0x72, 2) else bytes([register]) * count, 0)

    def write(self, register, data):
        return 0


@settings(max_examples=60)
@given(told=requests)
def test_it_answers_as_the_emulated_bridge_does(told, tmp_path_factory):
    chip = Registers()
    folder = tmp_path_factory.mktemp("flash")
    other = EmulatedBridge(chip, lambda: 0, window=2)
    bridge = program.Bridge([I2c(chip)], lambda: 0, f"{folder}/")
    for frame in [Frame(1, 0, wire.Hello().payload()), *told]:
        if frame.type == wire.Leave.TYPE:
            continue
        ours, theirs = (said(each, frame.encode()) for each in (bridge, other))
        assert [(each.type, each.seq) for each in ours] == [(each.type, each.seq) for each in theirs]
        if frame.type != wire.Hello.TYPE:
            assert [each.payload for each in ours] == [each.payload for each in theirs]


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


def test_its_clock_is_as_wide_as_the_protocols(pasted):
    seen = [0]
    bridge = pasted(None, lambda: seen[0])
    for t_s in range(0, 5000, 500):
        seen[0] = t_s * 1_000_000_000
        assert ask(bridge, wire.Read(0x75, 1)).t_us == t_s * 1_000_000 % 2**32


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
def test_a_whole_session_is_good(pasted, tmp_path):
    chip, clock = simulated()
    found = session(BridgeBus(EmulatedLine(pasted(chip, clock.now), clock)), chip, tmp_path)
    assert found.verdict == "good", json.dumps(found.quality["reasons"])


def test_a_whole_session_on_micropython_is_good(board, tmp_path):
    chip, clock = simulated()
    found = session(BridgeBus(MicroPythonPort(board(chip, clock))), chip, tmp_path)
    assert found.verdict == "good", json.dumps(found.quality["reasons"])
