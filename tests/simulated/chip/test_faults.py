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
from mpucal.errors import BusError, BusHeld, NoAnswer
from mpucal.files.mcap import read_capture
from mpucal.simulated.chip.bus import FastClock, FaultInjector, SimulatedBus
from mpucal.simulated.chip.chip import Chip
from mpucal.simulated.chip.models import MODELS, FactoryTrim
from mpucal.simulated.faults import OF_CHIP, Fault, fault_kinds
from mpucal.sources.replay import ReplayBus
from tools.lab.feeds import CONSTANT, NumberedFeed, numbers
from tools.make.fixtures import made_of_it, measured

CAPTURES = Path(__file__).parents[3] / "fixtures" / "faults"


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
    recording, error = measured(suffering(*faults, model=model, seed=seed), Config(rate_hz=rate_hz), 4.5)
    assert error is None or error.remedy
    assert (np.diff(recording.t) > 0).all()
    if not len(recording):
        return
    words = np.column_stack((recording.acc[:, 1] / 9.80665 * 8192, np.degrees(recording.gyr) * 65.5))
    true = (np.rint(words) == [CONSTANT[i] for i in (1, 4, 5, 6)]).all(axis=1)
    if any(fault.kind.flips for fault in faults):
        assert true.mean() > 0.9
        return
    assert true.all()
    if "frozen" not in {fault.name for fault in faults}:
        # a short freeze cannot be distinguished from equal samples
        steps = np.diff(numbers(recording))
        assert (steps >= 1).all()
        assert not ((steps != 1) & ~recording.gap[1:]).any()


@pytest.mark.parametrize("name", fault_kinds(*OF_CHIP))
def test_the_capture_of_a_fault_replays(name):
    capture = read_capture(CAPTURES / f"{name}.mcap")
    found = json.loads((CAPTURES / f"{name}.json").read_text())
    bus = ReplayBus(capture.records, name)
    recording, error = measured(bus)
    assert bus.unread() == 0
    again = made_of_it(recording, error)
    assert again.pop("rate_hz") == pytest.approx(found.pop("rate_hz"), rel=1e-9)
    assert again == found
    decoded = decode(capture.records, name)
    assert np.array_equal(decoded.t, recording.t)
    assert np.array_equal(decoded.acc, recording.acc)
