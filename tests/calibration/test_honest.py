"""Verdicts on recordings with a known truth: no `good` one has an error of three times its claim."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.calibration import calibrate
from mpucal.calibration.rotation import rotation
from mpucal.data import Recording
from mpucal.simulated.sensor import SensorTruth
from tools.lab.judge import sph_rms
from tools.lab.scenarios.recordings import hand_scenario, paper_scenario

G = 9.82
SCENES = ("paper", "pose12", "pose9", "pose6", "continuous", "turns")
# Units of accelerometer and gyroscope; only the first pair is right.
UNITS = ((1.0, 1.0), (1 / 9.80665, 1.0), (1e3 / 9.80665, 1.0), (1.0, np.degrees(1.0)), (1.0, 16.4 * np.degrees(1.0)))


@cache
def base(prepared, seed):
    """Return a recording at 200 Hz, from which samples are drawn."""
    if prepared == "paper":
        return paper_scenario(seed, rate_hz=200)
    return hand_scenario(seed, prepared, rate_hz=200, truth_hz=400)


def turned(truth, Q):
    """Return the sensor with the axes of both its sensors turned by Q, so that it starts in another orientation."""
    return SensorTruth(Q @ truth.D @ Q.T, Q @ truth.b_a, Q @ truth.K @ Q.T, Q @ truth.b_omega, truth.gravity)


@st.composite
def measured(draw):
    """Draw a recording and its truth: any rate, orientation at the start, noise, jitter and gaps."""
    simulated = base(draw(st.sampled_from(SCENES)), draw(st.integers(0, 1)))
    rng = np.random.default_rng(draw(st.integers(0, 2**16)))
    whole = simulated.recording
    every = draw(st.sampled_from((1, 2, 3, 4, 6, 10)))  # 200 to 20 Hz
    kept = np.arange(0, len(whole) - every, every)
    if draw(st.booleans()):
        kept += rng.integers(0, every, len(kept))  # taken at odd times, which are known
    for _ in range(draw(st.sampled_from((0, 0, 1, 3)))):
        first = draw(st.floats(0.0, 0.95)) * len(kept)
        kept = np.delete(kept, slice(int(first), int(first) + draw(st.integers(1, len(kept) // 20))))
    Q = rotation(draw(st.sampled_from((0.0, 0.5, np.pi / 2, 2.0, np.pi))) * _unit(rng.standard_normal(3)))
    acc_noise, gyr_noise = (10.0 ** draw(st.floats(*ends)) for ends in ((-4.0, 0.0), (-5.0, -1.0)))
    noise = rng.standard_normal((2, len(kept), 3))
    flat = draw(st.sampled_from((None, (0, int(np.searchsorted(kept, 9.5 * 200))))))
    recording = Recording.from_arrays(
        whole.t[kept] + draw(st.sampled_from((0.0, 1.7e9))),
        whole.acc[kept] @ Q.T + acc_noise * noise[0],
        whole.gyr[kept] @ Q.T + gyr_noise * noise[1],
        flat,
    )
    return recording, turned(simulated.truth, Q)


@settings(max_examples=30)
@given(measured(), st.sampled_from(UNITS))
def test_no_good_calibration_is_three_times_worse_than_it_claims(made, units):
    recording, truth = made
    of_acc, of_gyr = units
    calibration = calibrate(replace(recording, acc=of_acc * recording.acc, gyr=of_gyr * recording.gyr), "auto", G)
    if units != (1.0, 1.0):
        assert calibration.verdict != "good"
    if calibration.verdict == "refused":
        return
    numbers = [calibration.D, calibration.b_a, calibration.b_a_std, calibration.K]
    if calibration.fit["model"] != "static":  # in which the data sheet's tolerance may determine elements of D
        numbers.append(calibration.D_std)
    assert all(np.isfinite(x).all() for x in numbers)
    claimed = calibration.quality["error_std"]["rms"]
    assert claimed > 0.0
    if calibration.verdict == "good":
        assert sph_rms(truth, calibration.D, calibration.b_a) <= 3.0 * claimed


@pytest.mark.parametrize(("rate_hz", "turn_s"), [(20.0, 10.0), (1000.0, 3.0), (4000.0, 3.0)])
def test_at_the_slowest_and_the_fastest_rate(rate_hz, turn_s):
    simulated = paper_scenario(3, rate_hz=rate_hz, turn_s=turn_s)
    calibration = calibrate(simulated.recording, "auto", G)
    assert calibration.verdict == ("usable" if rate_hz == 20.0 else "good"), "so few samples leave a direction open"
    assert sph_rms(simulated.truth, calibration.D, calibration.b_a) <= 3.0 * calibration.quality["error_std"]["rms"]


def _unit(v):
    return v / np.linalg.norm(v)
