"""Faults of the simulated chip and the driver's reaction: to one, to pairs, and to their captures."""

import errno
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.chip import registers as reg
from mpucal.chip.config import Config
from mpucal.chip.decode import decode
from mpucal.chip.driver import Driver
from mpucal.errors import BusError, BusHeld, ChipError, NoAnswer
from mpucal.files.mcap import read_capture
from mpucal.simulated.chip.bus import FastClock, FaultInjector, SimulatedBus
from mpucal.simulated.chip.chip import Chip
from mpucal.simulated.chip.models import MODELS, FactoryTrim
from mpucal.simulated.faults import OF_CHIP, Fault, fault_kinds
from mpucal.sources.replay import ReplayBus

CAPTURES = Path(__file__).parents[3] / "fixtures" / "faults"
TRUE = (-700, 1500, -1600, 1700)


class NumberedFeed:
    """Feed of samples 0, 1, 2, ... in accelerometer x; every other word is constant, but for its scale."""

    def __init__(self):
        self.next = 0

    def samples(self, edges_s, setting):
        n = len(edges_s) - 1
        row = [0, TRUE[0], round(32768 / setting.accel_range_g), -2000, *TRUE[1:]]
        rows = np.tile(np.array(row, np.int16), (n, 1))
        rows[:, 0] = np.arange(self.next, self.next + n) % 30000
        self.next += n
        return rows


def suffering(*faults, model="mpu6050", seed=0):
    clock = FastClock()
    chip = Chip(MODELS[model], NumberedFeed(), 3000.0, FactoryTrim())
    return SimulatedBus(chip, clock, faults=FaultInjector(faults, chip, clock, np.random.default_rng(seed)))


@pytest.mark.parametrize(
    ("name", "kind", "number", "over"),
    [
        ("nack", NoAnswer, errno.EREMOTEIO, True),
        ("brownout", NoAnswer, errno.EREMOTEIO, True),
        ("timeout", BusHeld, errno.ETIMEDOUT, True),
        ("stuck", BusHeld, errno.ETIMEDOUT, False),
        ("unplugged", NoAnswer, errno.EREMOTEIO, False),
    ],
)
def test_a_transfer_fails_as_linux_would_tell_it(name, kind, number, over):
    bus = suffering(Fault(name, 1.0))
    assert bus.read(reg.WHO_AM_I, 1).data == b"\x68"
    for op in (lambda: bus.read(reg.WHO_AM_I, 1), lambda: bus.write(reg.SMPLRT_DIV, b"\x04")):
        bus.sleep_until(1_000_000_000)
        with pytest.raises(kind) as caught:
            op()
        assert caught.value.__cause__.errno == number
    bus.sleep_until(60_000_000_000)
    if over:
        assert bus.read(reg.WHO_AM_I, 1).data == b"\x68"
    else:
        with pytest.raises(BusError):
            bus.read(reg.WHO_AM_I, 1)


def measured(bus, seconds=6.0, config=None):
    driver = Driver(bus, config or Config())
    try:
        driver.start()
        while driver.now_ns() < seconds * 1e9:
            driver.poll()
    except (BusError, ChipError) as error:
        return driver.recording(), error
    return driver.recording(), None


def numbers(recording):
    return np.rint(recording.acc[:, 0] / 9.80665 * 8192).astype(int)


@pytest.mark.parametrize(
    ("name", "gaps", "lost_s"),
    [
        ("nack", 0, 0.0),
        ("timeout", 0, 0.0),
        ("overflow", 1, 2.1),
        ("brownout", 1, 0.7),
        ("frozen", 1, 2.0),
        ("slip", 1, 0.2),
        ("clock", 0, 0.0),
    ],
)
def test_a_passing_fault_is_a_gap_at_most(name, gaps, lost_s):
    recording, error = measured(suffering(Fault(name, 2.5)), config=Config(rate_hz=100))
    assert error is None
    assert gaps <= recording.gap.sum() <= 2 * gaps
    lost = np.diff(numbers(recording)) != 1
    if name != "brownout":  # whose sample clock begins anew
        assert lost.tolist() == recording.gap[1:].tolist()
    assert np.diff(recording.t).max() < 0.03 + lost_s
    assert np.diff(recording.t).min() > 0


# No driver can notice these.
UNSEEN = {"low_byte", "high_bit"}
places = st.builds(
    Fault, st.sampled_from(sorted({*fault_kinds(*OF_CHIP)} - UNSEEN)), st.floats(0, 4).map(lambda t: round(t, 3))
)


@settings(max_examples=15)
@given(
    faults=st.lists(places, min_size=1, max_size=2),
    model=st.sampled_from(["mpu6050", "mpu6500", "clone98"]),
    rate_hz=st.sampled_from([50, 200, 1000]),
    seed=st.integers(0, 9),
)
def test_delivered_samples_are_true_under_all_faults(faults, model, rate_hz, seed):
    """Every run ends in samples or in a message; only a noisy bus may make single values wrong."""
    recording, error = measured(suffering(*faults, model=model, seed=seed), 4.5, Config(rate_hz=rate_hz))
    assert error is None or error.remedy
    assert (np.diff(recording.t) > 0).all()
    if not len(recording):
        return
    gyr = np.rint(np.degrees(recording.gyr) * 65.5).astype(int)
    true = (gyr == TRUE[1:]).all(axis=1) & (np.rint(recording.acc[:, 1] / 9.80665 * 8192) == TRUE[0])
    if any(fault.kind.flips for fault in faults):
        assert true.mean() > 0.9
        return
    assert true.all()
    if "frozen" not in {fault.name for fault in faults}:
        # a sensor that thaws after a few samples may as well have measured the same
        steps = np.diff(numbers(recording))
        assert (steps >= 1).all()
        assert not ((steps != 1) & ~recording.gap[1:]).any()


@pytest.mark.parametrize("name", fault_kinds(*OF_CHIP))
def test_the_capture_of_a_fault_replays(name):
    capture = read_capture(CAPTURES / f"{name}.mcap")
    found = json.loads((CAPTURES / f"{name}.json").read_text())
    bus = ReplayBus(capture.records, name)
    driver, why = Driver(bus, Config(rate_hz=50)), None
    try:
        driver.start()
        while driver.now_ns() < 10e9:
            driver.poll()
        driver.stop()
    except BusError as error:
        why = str(error)
    recording = driver.recording()
    assert bus.unread() == 0
    assert (len(recording), recording.gap.sum(), why) == (found["samples"], found["gaps"], found["gave_up"])
    assert recording.sensor.rate_hz == pytest.approx(found["rate_hz"], rel=1e-9)
    decoded = decode(capture.records, name)
    assert np.array_equal(decoded.t, recording.t)
    assert np.array_equal(decoded.acc, recording.acc)
