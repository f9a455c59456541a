"""`calibrate`, with every kind of recording: reproducible numbers, a complete document, a verdict, an honest claim."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.calibration import MODELS, calibrate
from mpucal.calibration.parameters import ACCEL, D_NAMES
from mpucal.calibration.rotation import rotation
from mpucal.data import Recording, Sensor
from mpucal.errors import MpucalError, UsageError
from mpucal.simulated.sensor import SensorTruth
from tools.lab.judge import sph_rms
from tools.lab.scenarios.recordings import hand_scenario, paper_scenario

G = 9.82


def test_the_same_recording_twice_gives_the_same_bits(in_hand):
    first, second = (calibrate(in_hand.recording, "auto", G).document() for _ in range(2))
    assert {**first, "created": ""} == {**second, "created": ""}


def test_a_sensor_is_found_with_and_without_a_known_flat_segment():
    simulated = paper_scenario(1)
    given_flat = calibrate(simulated.recording, "auto", G)
    found = calibrate(replace(simulated.recording, flat=None), "auto", G)
    for calibration in (given_flat, found):
        # With the paper's noise, readings are uncertain by 0.08 m/s^2.
        assert {reason["code"] for reason in calibration.quality["reasons"]} <= {"few_orientations"}
        assert calibration.verdict != "refused"
        assert calibration.fit["model"] == "accel"
        assert sph_rms(simulated.truth, calibration.D, calibration.b_a) < 0.2
    # They are nearly equal: ten seconds of rest are not always found whole.
    assert (np.abs(found.D - given_flat.D) < 1.0 * given_flat.D_std).all()
    assert (np.abs(found.b_a - given_flat.b_a) < 1.0 * given_flat.b_a_std).all()


def test_the_document_describes_the_fit(ideal):
    simulated = ideal(0)
    recording = replace(simulated.recording, sensor=Sensor(chip="mpu6050", rate_hz=50.0))
    calibration = calibrate(recording, "auto", G)
    fit, document = calibration.fit, json.loads(calibration.json())
    assert (fit["model"], fit["parameters"], fit["converged"], fit["gravity"]) == ("accel", ACCEL, True, G)
    assert (fit["samples"], fit["seconds"]) == (2000, pytest.approx(39.98))
    assert 2.7 < fit["nis"] < 3.3
    assert document["sensor"]["chip"] == "mpu6050"
    np.testing.assert_allclose(calibration.noise_std, 0.08, rtol=0.1)
    np.testing.assert_allclose(calibration.gyro_noise_std, 0.03, rtol=0.1)
    assert document["gyroscope"]["K"] == np.eye(3).tolist()
    assert document["gyroscope"]["K_std"] == [[None] * 3] * 3  # not estimated
    after, before = document["quality"]["magnitude_after"], document["quality"]["magnitude_before"]
    assert after["median"] == pytest.approx(G, abs=0.02)
    assert after["std"] < before["std"]
    claimed = document["quality"]["error_std"]["rms"]
    assert sph_rms(simulated.truth, calibration.D, calibration.b_a) < 3.0 * claimed
    calibrated = calibration.apply(recording.acc)
    assert np.median(np.linalg.norm(calibrated, axis=1)) == pytest.approx(after["median"])


@pytest.mark.parametrize(
    ("model", "gravity", "remedy"),
    [("magic", G, "choose one of auto, hand, imu, accel, paper")]
    + [("auto", gravity, "give the local gravity") for gravity in (0.0, -9.81, np.nan, np.inf)],
)
def test_an_unknown_model_or_an_impossible_gravity_is_refused(ideal, model, gravity, remedy):
    with pytest.raises(UsageError, match=remedy):
        calibrate(ideal(0).recording, model, gravity)


def test_a_recording_is_identified_by_its_digest(ideal):
    recording = ideal(0).recording
    digest = calibrate(recording, "accel", G).fit["recording_digest"]
    assert len(digest) == 64
    later = replace(recording, t=recording.t + 86400.0, name="another name")
    # The rounding of a text file does not change the digest.
    rounded = replace(recording, acc=recording.acc * (1.0 + 1e-15))
    assert {calibrate(r, "accel", G).fit["recording_digest"] for r in (later, rounded)} == {digest}
    for other in (recording.part(0, len(recording) - 1), replace(recording, acc=recording.acc + 1e-4)):
        assert calibrate(other, "accel", G).fit["recording_digest"] != digest


# ---- recordings of any kind


@cache
def scene(name):
    scenario = paper_scenario(1, rate_hz=25) if name == "paper" else hand_scenario(1, name, rate_hz=25)
    return scenario.recording


# These are wrong units, and values that no sensor reads.
FACTORS = (1.0, 1.0, 1.0, 1e-300, 1e-30, 1e-3, 1 / 9.80665, 57.3, 1e3, 1e11, 1e150)
ends = st.floats(0.0, 1.0)


@st.composite
def recordings(draw):
    """Draw a spoilt recording of a simulated sensor: t, acc, gyr, flat."""
    base = scene(draw(st.sampled_from(("continuous", "paper", "pose6"))))
    n, rng = len(base), np.random.default_rng(draw(st.integers(0, 2**16)))
    faster = draw(st.sampled_from((1.0, 1.0, 0.8, 4.0, 160.0)))  # 20 Hz to 4 kHz
    jitter = draw(st.sampled_from((0.0, 0.0, 0.3, 0.99)))
    t = (base.t + jitter * 0.04 * rng.uniform(-0.5, 0.5, n)) / faster
    acc = (base.acc + draw(st.sampled_from((0.0, 1e-3, 1e-1, 1e1))) * rng.standard_normal((n, 3))) * draw(
        st.sampled_from(FACTORS)
    )
    gyr = (base.gyr * faster + draw(st.sampled_from((0.0, 1e-4, 1e-2, 1.0))) * rng.standard_normal((n, 3))) * draw(
        st.sampled_from((*FACTORS, 0.0))
    )
    for values in (acc, gyr):
        if draw(st.integers(0, 5)) == 0:
            axis = draw(st.integers(0, 2))
            values[:, axis] = draw(st.sampled_from((0.0, 5.0, values[0, axis])))
    kept = np.ones(n, bool)
    for _ in range(draw(st.sampled_from((0, 0, 1, 4)))):
        first = int(draw(ends) * n)
        kept[first : first + draw(st.integers(1, n // 3))] = False
    if draw(st.integers(0, 3)) == 0:
        first, last = sorted((int(draw(ends) * n), int(draw(ends) * n)))
        kept[:first] = kept[last + 2 :] = False
    if draw(st.integers(0, 5)) == 0:
        kept[np.flatnonzero(kept)[draw(st.integers(2, 60)) :]] = False
    kept[:2] |= kept.sum() < 2
    m = int(kept.sum())
    flat = draw(st.sampled_from((None, "start", "any")))
    if flat == "any":
        first = draw(st.integers(0, m - 1))
        flat = (first, draw(st.integers(first + 1, m)))
    elif flat == "start":
        flat = (0, max(int(kept[: n // 4].sum()), 1))
    if draw(st.integers(0, 9)) == 0:
        t = t * draw(st.sampled_from((1e-9, 1e-3, 1e3, 1e9)))
    return t[kept], acc[kept], gyr[kept], flat


@settings(max_examples=35)
@given(recordings(), st.sampled_from([model for model in MODELS if model != "paper"]))
def test_every_recording_gets_a_verdict(arrays, model):
    try:
        recording = Recording.from_arrays(*arrays)
    except MpucalError as error:
        assert str(error).endswith(".")
        return
    calibration = calibrate(recording, model, G)
    document = json.loads(calibration.json(), parse_constant=pytest.fail)
    assert document["quality"]["verdict"] in ("good", "usable", "refused")
    if calibration.verdict == "refused":
        assert document["quality"]["reasons"]
    else:
        # the static model estimates no gyroscope
        of_gyro = () if calibration.fit["model"] == "static" else ("b_omega", "K")
        for name in ("D", "b_a", "b_a_std", *of_gyro):
            assert np.isfinite(getattr(calibration, name)).all(), name
        at_prior = np.isin(D_NAMES, calibration.fit["at_prior"]).reshape(3, 3)
        assert np.array_equal(np.isfinite(calibration.D_std), ~at_prior)
        assert np.linalg.det(calibration.D) > 0
    for reason in document["quality"]["reasons"]:
        assert not {"nan", "inf", "-inf"} & set(reason["message"].replace("(", " ").split())


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
    Q = rotation(draw(st.sampled_from((0.0, 0.5, np.pi / 2, 2.0, np.pi))) * np.array([0.6, -0.64, 0.48]))
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


@settings(max_examples=20)
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


@pytest.mark.parametrize(("rate_hz", "turn_s"), [(20.0, 10.0), (4000.0, 3.0)])
def test_at_the_slowest_and_the_fastest_rate(rate_hz, turn_s):
    simulated = paper_scenario(3, rate_hz=rate_hz, turn_s=turn_s)
    calibration = calibrate(simulated.recording, "auto", G)
    assert calibration.verdict == ("usable" if rate_hz == 20.0 else "good"), "so few samples leave a direction open"
    assert sph_rms(simulated.truth, calibration.D, calibration.b_a) <= 3.0 * calibration.quality["error_std"]["rms"]
