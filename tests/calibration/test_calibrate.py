"""`calibrate`, with every kind of recording: reproducible numbers, a complete document, a verdict."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.calibration import MODELS, calibrate
from mpucal.calibration.parameters import ACCEL, D_NAMES
from mpucal.data import Recording, Sensor
from mpucal.errors import MpucalError, UsageError
from tools.lab.judge import sph_rms
from tools.lab.scenarios.recordings import hand_scenario, paper_scenario

G = 9.82


def numbers(calibration):
    """Return the document without the time of its creation."""
    return {key: value for key, value in calibration.document().items() if key != "created"}


@pytest.mark.parametrize("prepared", ["paper", "pose12", "continuous"])
def test_the_same_recording_twice_gives_the_same_bits(hand, prepared):
    recording = (paper_scenario(0, rate_hz=50) if prepared == "paper" else hand(1, prepared)).recording
    first, second = calibrate(recording, "auto", G), calibrate(recording, "auto", G)
    for name in ("D", "b_a", "K", "b_omega", "D_std", "b_a_std", "K_std"):
        assert getattr(first, name).tobytes() == getattr(second, name).tobytes()
    assert numbers(first) == numbers(second)


@pytest.mark.parametrize("number", range(2))
def test_sensors_of_another_simulator_are_found_with_and_without_a_known_flat_segment(other_simulator, number):
    other = other_simulator(f"paper_{number}")
    given_flat = calibrate(other.recording, "auto", G)
    found = calibrate(replace(other.recording, flat=None), "auto", G)
    for calibration in (given_flat, found):
        # With the paper's noise, readings are uncertain by 0.08 m/s^2.
        assert {reason["code"] for reason in calibration.quality["reasons"]} <= {"few_orientations"}
        assert calibration.verdict != "refused"
        assert calibration.fit["model"] == "accel"
        assert sph_rms(other.truth, calibration.D, calibration.b_a) < 0.2
    # They are nearly equal: ten seconds of rest are not always found whole.
    assert (np.abs(found.D - given_flat.D) < 1.0 * given_flat.D_std).all()
    assert (np.abs(found.b_a - given_flat.b_a) < 1.0 * given_flat.b_a_std).all()


def test_the_time_of_the_first_sample_makes_no_difference(ideal):
    recording = ideal(0).recording
    late = replace(recording, t=recording.t + 86400.0)
    np.testing.assert_allclose(calibrate(late, "auto", G).D, calibrate(recording, "auto", G).D, atol=1e-7)


@pytest.mark.parametrize("prepared", ["paper", "pose12"])
def test_jittered_times_do_no_harm_if_they_are_recorded(hand, prepared):
    simulated = paper_scenario(0, rate_hz=200) if prepared == "paper" else hand(1, prepared, rate_hz=200)
    recording, truth = simulated.recording, simulated.truth
    rng = np.random.default_rng(0)
    # One of each two samples is kept: they are 5, 10 or 15 ms apart.
    kept = np.arange(0, len(recording), 2) + rng.integers(0, 2, len(recording) // 2)
    thin = Recording.from_arrays(recording.t[kept], recording.acc[kept], recording.gyr[kept], flat=(0, 1000))
    plain, jittered = calibrate(recording, "auto", G), calibrate(thin, "auto", G)
    limit = 3.0 * sph_rms(truth, plain.D, plain.b_a) + 0.01
    assert sph_rms(truth, jittered.D, jittered.b_a) < limit


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


@pytest.mark.parametrize("model", ["accel", "imu", "hand"])
def test_a_model_that_was_asked_for_is_used(ideal, model):
    calibration = calibrate(ideal(0).recording, model, G)
    assert calibration.fit["model"] == model
    assert calibration.fit["why"] == "asked for"


@pytest.mark.parametrize(
    ("model", "gravity", "remedy"),
    [("magic", G, "choose one of auto, hand, imu, accel, paper")]
    + [("auto", gravity, "give the local gravity") for gravity in (0.0, -9.81, np.nan, np.inf)],
)
def test_an_unknown_model_or_an_impossible_gravity_is_refused(ideal, model, gravity, remedy):
    with pytest.raises(UsageError, match=remedy):
        calibrate(ideal(0).recording, model, gravity)


# ---- spoilt recordings


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


@settings(max_examples=50)
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
        for name in ("D", "b_a", "b_a_std", "b_omega", "K"):
            assert np.isfinite(getattr(calibration, name)).all(), name
        at_prior = np.isin(D_NAMES, calibration.fit["at_prior"]).reshape(3, 3)
        assert np.array_equal(np.isfinite(calibration.D_std), ~at_prior)
        assert np.linalg.det(calibration.D) > 0
    for reason in document["quality"]["reasons"]:
        assert not {"nan", "inf", "-inf"} & set(reason["message"].replace("(", " ").split())


def test_a_recording_is_identified_by_its_digest(ideal):
    recording = ideal(0).recording
    digest = calibrate(recording, "accel", G).fit["recording_digest"]
    assert len(digest) == 64
    later = replace(recording, t=recording.t + 1.0, name="another name")
    # The rounding of a text file does not change the digest.
    rounded = replace(recording, acc=recording.acc * (1.0 + 1e-15))
    assert {calibrate(r, "accel", G).fit["recording_digest"] for r in (later, rounded)} == {digest}
    for other in (recording.part(0, len(recording) - 1), replace(recording, acc=recording.acc + 1e-4)):
        assert calibrate(other, "accel", G).fit["recording_digest"] != digest


def test_spikes_of_the_gyroscope_are_removed(hand):
    scenario = hand(3, "pose12")
    rng, gyr = np.random.default_rng(5), scenario.recording.gyr.copy()
    gyr[rng.integers(0, len(gyr), 10), rng.integers(0, 3, 10)] += 40.0 * rng.normal(size=10)
    spoilt, whole = calibrate(replace(scenario.recording, gyr=gyr)), calibrate(scenario.recording)
    assert spoilt.verdict == "good"
    assert np.abs(spoilt.D - whole.D).max() < 1e-3


def test_a_rate_that_repeats_while_the_board_turns_is_lost_data(hand):
    recording = hand(3, "pose12").recording
    rates = np.abs(recording.gyr[:, 1])
    turning = int(np.flatnonzero(rates > 0.5 * rates.max())[0])
    gyr = recording.gyr.copy()
    gyr[turning : turning + 300, 1] = gyr[turning, 1]
    spoilt = calibrate(replace(recording, gyr=gyr))
    assert [reason["code"] for reason in spoilt.quality["reasons"]] == ["data_lost"]
    assert np.abs(spoilt.D - calibrate(recording).D).max() < 2e-3
