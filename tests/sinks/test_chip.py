"""b_a in a chip's offset registers: its words, their effect, and the old or the new state after each failure."""

from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.chip import registers as reg
from mpucal.chip.access import Reply
from mpucal.data import STANDARD_GRAVITY_MPS2, Sensor
from mpucal.errors import BusError, NoAnswer, RecordingError, WriteBackError
from mpucal.result.calibration import REFUSED, Calibration
from mpucal.simulated.chip import Chip, SimulatedBus
from mpucal.simulated.chip.bus import FastClock
from mpucal.simulated.chip.models import MODELS, OFFSETS, FactoryTrim
from mpucal.sinks.chip import ChipSink
from mpucal.sinks.table import CHIP_OFFSETS

BIAS_G = np.array([0.032, -0.011, -0.054])
TRIM = (-1501, 2000, 701)
HIGH = {"mpu6050": (0x06, 0x08, 0x0A), "mpu6500": (0x77, 0x7A, 0x7D), "clone98": (0x77, 0x7A, 0x7D)}


class AtRest:
    """A perfect accelerometer but for its bias, lying flat in 1 g."""

    def __init__(self, shakes_g=0.0):
        self.rng, self.shakes_g = np.random.default_rng(5), shakes_g

    def samples(self, edges_s, setting):
        n = len(edges_s) - 1
        g = (
            np.array([0.0, 0.0, 1.0])
            + BIAS_G
            + setting.accel_offset_g
            + self.shakes_g * np.sin(25.0 * edges_s[1:, None])
        )
        rows = np.zeros((n, 7))
        rows[:, :3] = g * 32768 / setting.accel_range_g
        return np.rint(rows + self.rng.normal(size=rows.shape)).astype(np.int16)


class Board:
    """A chip of a model, its bus, and the accesses of it that fail.

    Attributes
    ----------
    fails : by number of the access, whether it is done nonetheless.
    """

    def __init__(self, model="mpu6050", offsets="2048", who_am_i=None, feed=None, trim=TRIM):
        self.model = MODELS[model]._replace(**OFFSETS[offsets])
        if who_am_i is not None:
            self.model = self.model._replace(who_am_i=who_am_i)
        self.chip = Chip(self.model, feed or AtRest(), 0.0, FactoryTrim(trim))
        self.inner = SimulatedBus(self.chip, FastClock())
        self.accesses, self.fails = 0, {}

    def read(self, register, count):
        done = self._fails()
        reply = self.inner.read(register, count)
        if done is not None:
            raise BusError("a transfer broke off", "check the wires")
        return Reply(reply.data, reply.t_ns)

    def write(self, register, data):
        done = self._fails()
        t_ns = self.inner.write(register, data) if done is not False else 0
        if done is not None:
            raise BusError("a transfer broke off", "check the wires")
        return t_ns

    def sleep_until(self, t_ns):
        self.inner.sleep_until(t_ns)

    def close(self):
        self.inner.close()

    def words(self):
        high = self.model.family.accel_offset_h
        return tuple(int.from_bytes(self.inner.read(address, 2).data, "big", signed=True) for address in high)

    def sink(self):
        return ChipSink(self, "the chip of the test")

    def _fails(self):
        self.accesses += 1
        return self.fails.get(self.accesses)


def calibration(accel_offsets=TRIM, **changes):
    """Return a calibration of that board from before any write."""
    sensor = Sensor(chip="MPU-6050", who_am_i=None, accel_offsets=accel_offsets)
    return Calibration(np.eye(3), BIAS_G * STANDARD_GRAVITY_MPS2, sensor=sensor, **changes)


def corrected(lsb_per_g):
    """The 15-bit words that take BIAS_G away, with the factory's bit 0."""
    return tuple(
        (trim - trim % 2) + 2 * round(-bias * lsb_per_g / 2) + trim % 2 for trim, bias in zip(TRIM, BIAS_G, strict=True)
    )


@pytest.mark.parametrize(
    ("model", "scale", "who_am_i"),
    [("mpu6050", "2048", None), ("mpu6050", "4096", None), ("mpu6500", "2048", 0x68), ("clone98", "4096", 0x68)],
)
def test_the_bias_lands_where_it_belongs_and_all_else_stays(model, scale, who_am_i):
    board = Board(model, scale, who_am_i)
    before = board.inner.read(reg.SMPLRT_DIV, 5).data, board.inner.read(reg.PWR_MGMT_1, 2).data
    applied = board.sink().write(calibration())
    assert board.words() == corrected(float(scale))
    hardware_mg = applied.calibration.applied_in_hardware / STANDARD_GRAVITY_MPS2 * 1000
    assert hardware_mg == pytest.approx(BIAS_G * 1000, abs=0.5)
    assert f"0x{HIGH[model][0]:02x}" in applied.what
    assert "volatile" in applied.what
    assert (board.inner.read(reg.SMPLRT_DIV, 5).data, board.inner.read(reg.PWR_MGMT_1, 2).data) == before


def test_the_bias_is_removed_once():
    """Correct samples after the write by the calibration that it returns: only gravity is left."""
    board = Board()
    applied = board.sink().write(calibration()).calibration
    board.inner.write(reg.PWR_MGMT_1, b"\x01")
    board.inner.write(reg.ACCEL_CONFIG, b"\x00")
    board.inner.sleep_until(10**12)
    data = board.inner.read(reg.ACCEL_XOUT_H, 6).data
    acc = np.frombuffer(data, ">i2") / 16384 * STANDARD_GRAVITY_MPS2
    assert applied.apply(acc) == pytest.approx([0, 0, STANDARD_GRAVITY_MPS2], abs=0.005)
    assert acc == pytest.approx([0, 0, STANDARD_GRAVITY_MPS2], abs=0.01)


@pytest.mark.parametrize("known", [TRIM, None], ids=["trim_known", "trim_unknown"])
def test_writing_twice_is_writing_once(known):
    board = Board()
    for _ in range(2):
        board.sink().write(calibration(accel_offsets=known))
        assert board.words() == corrected(2048.0)


def test_the_old_words_come_back_from_their_file(tmp_path):
    board = Board("mpu6500")
    (kept,) = board.sink().keep(tmp_path)
    board.sink().write(calibration())
    assert board.words() != TRIM
    # a saved state is not overwritten
    assert board.sink().keep(tmp_path) != (kept,)
    assert CHIP_OFFSETS.name in board.sink().put_back(kept)
    assert board.words() == TRIM


@pytest.mark.parametrize(
    "text", ["[]", '{"format": "mpucal.chip_offsets", "registers": {"0x06": "00"}}'], ids=["list", "short"]
)
def test_another_file_is_not_put_back(tmp_path, text):
    board, path = Board(), tmp_path / CHIP_OFFSETS.name
    path.write_text(text)
    with pytest.raises(RecordingError, match="offset registers"):
        board.sink().put_back(path)
    assert board.words() == TRIM


@pytest.mark.parametrize(
    ("board", "changes", "words"),
    [
        (Board(offsets="readonly"), {}, "does not respond to its offset registers"),
        (
            Board(),
            {"sensor": Sensor(accel_offsets=(1, 2, 3))},
            "factory trim of this chip is .* but .1, 2, 3. in the one",
        ),
        (Board(), {"quality": {"verdict": REFUSED}}, "nothing was written: the calibration was refused"),
        (Board(), {"extra": {"autopilot": {}}}, "nothing was written: .*autopilot"),
        (Board(feed=AtRest(shakes_g=0.3)), {}, "the board moves"),
        (Board(), {"sensor": Sensor(who_am_i=0x70)}, "WHO_AM_I of this chip is 0x68, but 0x70 of the calibrated one"),
        (Board(), {"b_a": np.array([0.0, 0.0, 1.5])}, "not 9.81"),
    ],
    ids=["read_only", "other_piece", "refused", "autopilot", "moves", "who_am_i", "gravity"],
)
def test_a_refusal_leaves_all_as_it_was(board, changes, words):
    with pytest.raises(WriteBackError, match=words):
        board.sink().write(replace(calibration(), **changes))
    assert board.words() == TRIM


def test_a_bias_that_does_not_fit_is_refused():
    board = Board(trim=(32000, 0, 0))
    with pytest.raises(WriteBackError, match="cannot hold"):
        board.sink().write(replace(calibration(accel_offsets=None), b_a=np.array([-9.0, 0.0, 0.0])))
    assert board.words() == (32000, 0, 0)


# one whole write takes this many accesses, or a few more
ACCESSES = 700


@settings(max_examples=45)
@given(
    model=st.sampled_from(["mpu6050", "mpu6500"]),
    corrected_before=st.booleans(),
    trim_known=st.booleans(),
    first=st.integers(1, ACCESSES),
    count=st.integers(1, 12),
    done=st.booleans(),
)
def test_a_fault_at_any_step_leaves_the_old_state_or_the_new(model, corrected_before, trim_known, first, count, done):
    """Transfers `first` to `first + count` fail, those of them that write with or without effect."""
    board, written = Board(model), corrected(2048.0)
    if corrected_before:
        old = (-1001, 2400, 801)
        for high, word in zip(HIGH[model], old, strict=True):
            board.inner.write(high, word.to_bytes(2, "big", signed=True))
    else:
        old = TRIM
    assert board.words() == old
    board.fails = dict.fromkeys(range(first, first + count), done)
    try:
        board.sink().write(calibration(accel_offsets=TRIM if trim_known else None))
    except WriteBackError as error:
        assert board.words() == old, error
    else:
        assert board.words() == written


def test_a_wire_that_stays_pulled_is_reported_with_its_remedy():
    board = Board()
    board.fails = dict.fromkeys(range(300, 100_000), False)
    with pytest.raises(WriteBackError, match=r"could not be restored .*switch the chip's supply off and on"):
        board.sink().write(calibration())


def test_an_interrupted_write_is_undone():
    class Interrupted(Board):
        def read(self, register, count):
            if self.accesses == 300:
                self.accesses += 1
                raise KeyboardInterrupt
            return super().read(register, count)

    board = Interrupted()
    with pytest.raises(KeyboardInterrupt):
        board.sink().write(calibration())
    assert board.words() == TRIM


def test_a_missing_chip_is_reported_before_anything_is_written():
    board = Board()
    board.read = Mock(side_effect=NoAnswer("nothing answers at 0x68 on the bus", "check VCC, GND, SDA and SCL"))
    with pytest.raises(WriteBackError, match="nothing was written: nothing answers"):
        board.sink().write(calibration())
