"""Sessions at different temperatures made into one calibration: b_a(T) where they show one, else a sentence."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.data import Sensor
from mpucal.errors import RefusedError, UsageError
from mpucal.result.blob import LENGTHS
from mpucal.result.calibration import Calibration
from mpucal.result.merge import merge

SLOPE = np.array([0.005, -0.012, 0.0004])
B_STD = np.array([0.004, 0.006, 0.01])
D_STD = np.full((3, 3), 2e-4)


def session(T, rng, slope=SLOPE, curve=0.0, D_slope=0.0, **changes):
    b_a = np.array([0.3, -0.2, 1.1]) + slope * (T - 25.0) + curve * (T - 25.0) ** 2
    made = Calibration(
        np.diag([1.02, 0.99, 1.0]) * (1 + D_slope * (T - 25.0)) + rng.normal(size=(3, 3)) * D_STD,
        b_a + rng.normal(size=3) * B_STD,
        D_STD,
        B_STD,
        quality={"verdict": "good", "reasons": []},
        fit={"gravity": 9.80665},
        sensor=Sensor(chip="MPU-6050", who_am_i=0x68, temperature_c=T, accel_offsets=(1, 2, 3)),
        created=f"2024-05-{int(T):02d}T09:30:00+00:00",
    )
    return replace(made, **changes)


def test_a_slope_is_found_to_its_own_uncertainty():
    z = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        made = merge([session(T, rng) for T in (5.0, 20.0, 31.0)]).calibration
        assert made.follows_temperature
        z.append((made.b_a_slope - SLOPE) / made.b_a_slope_std)
    # rms of 180 numbers that should be standard normal
    assert np.sqrt(np.mean(np.square(z))) == pytest.approx(1.0, abs=0.2)


def test_the_merged_one_corrects_at_every_temperature(tmp_path):
    rng = np.random.default_rng(1)
    made = merge([session(T, rng) for T in (5.0, 20.0, 31.0)]).calibration
    s = np.array([1.0, -3.0, 9.0])
    for T in (7.0, 30.0):
        y = np.diag([1.02, 0.99, 1.0]) @ s + np.array([0.3, -0.2, 1.1]) + SLOPE * (T - 25.0)
        assert made.apply(y, temperature_c=T) == pytest.approx(s, abs=0.03)
    # beyond the measured range it is that of the range's end
    assert np.array_equal(made.apply(s, temperature_c=80.0), made.apply(s, temperature_c=31.0))
    assert np.array_equal(made.apply(s, temperature_c=np.nan), made.apply(s))
    for name in ("c.json", "c.bin"):
        made.save(tmp_path / name)
        again = Calibration.load(tmp_path / name)
        assert again.apply(s, temperature_c=10.0) == pytest.approx(made.apply(s, temperature_c=10.0), abs=1e-5)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"temperatures": (20.0, 22.0, 23.0)}, "span 3.0 °C"),
        ({"slope": np.zeros(3)}, "the slope is not significant"),
        ({"curve": 0.001}, "no line fits"),
    ],
    ids=["too near", "flat", "curved"],
)
def test_unsupported_temperature_models_are_reported(changes, says):
    rng = np.random.default_rng(3)
    temperatures = changes.pop("temperatures", (5.0, 15.0, 31.0))
    made = merge([session(T, rng, **changes) for T in temperatures])
    assert "do not support" in made.why
    assert says in made.why
    assert not made.calibration.follows_temperature
    assert len(made.calibration.blob().encode()) == LENGTHS[2]


def test_a_gain_that_changes_with_temperature_is_reported():
    rng = np.random.default_rng(4)
    made = merge([session(T, rng, D_slope=2e-4) for T in (5.0, 15.0, 31.0)])
    assert "D changed with temperature" in made.remarks[0]


RNG = np.random.default_rng(5)


@pytest.mark.parametrize(
    ("others", "error", "says"),
    [
        ([], UsageError, "only one"),
        ([session(30.0, RNG, quality={"verdict": "refused"})], RefusedError, "refused"),
        ([session(30.0, RNG, b_a_std=np.full(3, np.nan))], UsageError, "its uncertainties"),
        ([session(30.0, RNG, sensor=Sensor(who_am_i=0x70, temperature_c=30.0))], UsageError, "different sensors"),
        ([session(30.0, RNG, fit={"gravity": 9.81})], UsageError, "gravities"),
        ([session(30.0, RNG, applied_in_hardware=np.ones(3))], UsageError, "offset registers"),
        ([session(30.0, RNG, extra={"autopilot": {"imu": 1}})], UsageError, "autopilot"),
        ([session(30.0, RNG, b_a_slope=np.ones(3))], UsageError, "merged already"),
    ],
)
def test_calibrations_that_cannot_be_merged_are_refused(others, error, says):
    with pytest.raises(error, match=says):
        merge([session(10.0, RNG), *others])


def test_a_recording_is_merged_only_once():
    """Know it by its digest, also one that was merged before, and without a digest by the numbers."""

    def made_of(T, digest):
        return session(T, np.random.default_rng(0), fit={"gravity": 9.80665, "recording_digest": digest})

    a, b, c, again = (made_of(T, digest) for T, digest in ((10.0, "a"), (11.0, "b"), (12.0, "c"), (13.0, "a")))
    with pytest.raises(RefusedError, match=r"calibrations 1 and 3 were made of the same recording.*each once"):
        merge([a, b, again])
    both = merge([a, b]).calibration
    assert [part["recording_digest"] for part in both.extra["merged"]] == ["a", "b"]
    merge([both, c])
    with pytest.raises(RefusedError, match="calibrations 1 and 2 were made of the same recording"):
        merge([both, b])
    nameless = made_of(10.0, None)
    merge([nameless, made_of(30.0, None)])
    with pytest.raises(RefusedError, match="the same recording"):
        merge([nameless, nameless])
