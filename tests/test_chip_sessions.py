"""Supported chips, with faults and without: each session ends in a true calibration or a justified refusal.

Each part is simulated from its row: the driver calls it by its name and knows its temperature. Sessions with faults are
those of the campaign, and their replays those of test_session_replay.py.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.calibration import calibrate
from mpucal.calibration.hand import fit_hand
from mpucal.chip.config import Config
from mpucal.chip.decode import decode
from mpucal.chip.driver import Driver
from mpucal.chip.families import PARTS
from mpucal.errors import SourceError
from mpucal.rests.flat import find_flat, flat_statistics
from mpucal.result.calibration import GOOD
from mpucal.session.events import PromptKind
from mpucal.session.plan import Plan
from mpucal.session.runner import Runner
from mpucal.simulated.chip import open_simulated
from mpucal.simulated.chip.models import MODELS
from mpucal.simulated.faults import OF_CHIP, Fault, fault_kinds
from mpucal.sources.replay import Tap
from tools.lab.sessions import NOTHING, Session, SilentOperator, by_command, judge_session, recorded

FAULTS = tuple(fault_kinds(*OF_CHIP))
HALF = -(-len(FAULTS) // 2)
CHIPS = ("mpu6050", "mpu6500", "clone98")
RECORDED_S, RATE_HZ, POLL_S = 45, 50.0, 0.2
CODES, FARTHEST_Z = (0, 3, 4, 5), 6.0


def with_faults(words):
    """Record a chip for so long, as far as it gives samples, and calibrate."""
    plan = Plan(Config(rate_hz=RATE_HZ, poll_s=POLL_S), until_end=True)
    bus, accesses, said = open_simulated(words), [], ""
    tapped = Tap(bus, accesses.append)
    try:
        Runner(Driver(tapped, plan.config), SilentOperator(), lambda *_: None, plan, (bus.hear,)).record(RECORDED_S)
    except SourceError as error:
        said = str(error)
    try:
        recording = decode(accesses)
    except SourceError as error:
        return Session(code=SourceError.exit_code, said=said or str(error))
    return Session(calibrate(recording), bus.truth_document(), recording, said=said)


@pytest.mark.parametrize("number", range(HALF))
@settings(max_examples=1)
@given(seed=st.integers(0, 2**32 - 1))
def test_no_pair_of_faults_makes_a_wrong_calibration_good(number, seed):
    """Two faults affect a recorded chip together; what is calibrated afterwards is true, or refused."""
    rng = np.random.default_rng([seed, number])
    faults = [Fault(name, round(float(rng.uniform(0.0, RECORDED_S)), 2)) for name in FAULTS[number::HALF]]
    done = with_faults(f"sim:seed={seed},chip={CHIPS[seed % len(CHIPS)]},fault={'/'.join(map(str, faults))}")
    ended = judge_session("", seed, done, "" if done.code in CODES else f"exit code {done.code}")
    assert not ended.wrong, (faults, seed, ended)
    assert ended.verdict != GOOD or max(map(abs, ended.z)) <= FARTHEST_Z, (faults, seed, ended)
    assert ended.verdict != NOTHING or ended.said


def parts():
    """Each part as --bus sim: names it, with its name and the source of its row; revision C is one more."""
    by_family = {model.family: name for name, model in reversed(MODELS.items())}
    for who_am_i, part in PARTS.items():
        yield f"{by_family[part.family]},who_am_i={who_am_i:#04x}", part.chip, part.family.source
    yield "mpu6050c", "MPU-6050C", PARTS[0x68].family.source


@pytest.mark.parametrize(("words", "name", "source"), [*parts()])
def test_a_part_has_its_name_its_temperature_and_a_source(words, name, source):
    bus = open_simulated(f"sim:chip={words},seed=4,temperature_c=27")
    recording = recorded(bus, Config(), (PromptKind.LAY_FLAT, 1.0))
    assert (recording.sensor.chip, bool(source)) == (name, True)
    assert recording.temperature_c.mean() == pytest.approx(27, abs=0.3)


@pytest.mark.slow
@pytest.mark.parametrize(("words", "name", "source"), [*parts()])
def test_a_session_on_a_part_ends_good(words, name, source):
    done, document = by_command("--bus", f"sim:chip={words}", "--seed", "4", "--rate", "50", "--model", "hand")
    assert (done.calibration.verdict, document["sensor"]["chip"]) == (GOOD, name), source
    np.testing.assert_allclose(done.calibration.D, done.truth["D"], atol=2e-3)


FLAT_S, TURNED_S = 12.0, 100.0


@cache
def turned(chip):
    """A recording of the chip in a hand that turns it as it likes, and the D that it has."""
    bus = open_simulated(f"sim:seed=3,hand=random,chip={chip},temperature_c=27")
    steps = (PromptKind.LAY_FLAT, FLAT_S), (PromptKind.ROTATE, TURNED_S)
    return recorded(bus, Config(rate_hz=50, poll_s=0.25), *steps), np.array(bus.truth_document()["D"])


@pytest.mark.parametrize(("chip", "name"), [("icm20690", "ICM-20690"), ("mpu6050,fault=no_fifo", "MPU-6050")])
def test_a_chip_with_samples_of_its_own_gives_a_good_calibration(chip, name):
    """The other parts differ from these, and from the chips above, by what tests/chip shows."""
    recording, D = turned(chip)
    assert recording.sensor.chip == name
    assert recording.temperature_c.mean() == pytest.approx(27, abs=0.3)
    assert not recording.gap.any()
    found = calibrate(recording, model="hand")
    assert found.verdict == GOOD
    assert np.abs(found.D - D).max() < 3e-3


@pytest.mark.slow
def test_the_filter_delay_of_a_6500_is_found_and_assumed():
    """The gyroscope is a millisecond later than its accelerometer, and the estimate is drawn towards that."""

    def fitted(recording, **told):
        recording = replace(recording, sensor=replace(recording.sensor, **told))
        return fit_hand(recording, flat_statistics(recording, find_flat(recording)), 9.80665).honest()

    (of_6050, _), (of_6500, _) = turned("mpu6050"), turned("mpu6500")
    assert fitted(of_6500).delay_s - fitted(of_6050).delay_s == pytest.approx(-1e-3, abs=2e-4)
    drawn = fitted(of_6500).delay_s - fitted(of_6500, accel_lag_s=0.0).delay_s
    assert -3e-4 < drawn < -1e-5
