"""Allan deviation compared with allantools, coefficients with simulated noise, and disturbances of a rest."""

import json
from dataclasses import replace

import numpy as np
import pytest

import mpucal
from mpucal.allan import NoiseMeter, noise_of
from mpucal.allan.model import fit_coefficients
from mpucal.allan.trace import Octaves
from mpucal.data import Recording, Sensor
from mpucal.export.forms import form
from mpucal.result.noise import Noise, with_noise
from tools.lab.scenarios.noise import noise

RATE_HZ = 100.0
TRUE = {"white_noise": 2.8e-3, "bias_instability": 1.0e-3, "random_walk": 1e-4}
SENSOR = Sensor(chip="MPU-6050", rate_hz=RATE_HZ)


def rest(n=2**17, seed=0, **coefficients):
    drawn = {**TRUE, **coefficients}
    rng = np.random.default_rng(seed)
    six = np.stack([noise(rng, n, RATE_HZ, *drawn.values()) for _ in range(6)], axis=1)
    temperature_c = 25.0 + 0.01 * rng.standard_normal(n)
    return Recording.from_arrays(
        np.arange(n) / RATE_HZ, six[:, :3] + [0, 0, 9.8], six[:, 3:], temperature_c=temperature_c, sensor=SENSOR
    )


@pytest.fixture(scope="module")
def lying():
    return rest()


@pytest.fixture(scope="module")
def found(lying):
    return noise_of(lying)


def test_the_deviation_is_that_of_allantools(lying):
    allantools = pytest.importorskip("allantools")
    values = lying.acc[:12_000, :2].T
    octaves = Octaves(2)
    for part in np.array_split(values, 37, axis=1):
        octaves.add(part)
    sizes, variances, counts = octaves.variances()
    for axis in range(2):
        _, theirs, _, n = allantools.oadev(
            values[axis], rate=1.0, data_type="freq", taus=sizes[sizes <= 2048].astype(int)
        )
        ours = np.sqrt(variances[: len(theirs), axis])
        every = sizes[: len(theirs)] <= 16
        np.testing.assert_allclose(ours[every], theirs[every], rtol=1e-9)
        np.testing.assert_array_equal(counts[: len(theirs)][every], n[every])
        # longer intervals are averaged only at every 16th of tau
        np.testing.assert_allclose(ours, theirs, rtol=0.03)


def test_octaves_are_independent_of_the_division_of_samples_and_of_bounded_size(lying):
    values = lying.gyr[:50_000].T
    at_once, in_parts = Octaves(3), Octaves(3)
    at_once.add(values)
    for part in np.array_split(values, 1001, axis=1):
        in_parts.add(part)
    # each subtracts the mean of its first part, which changes the last digits
    for one, other in zip(at_once.variances(), in_parts.variances(), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-7)
    assert sum(level._tail.shape[1] for level in in_parts._levels) <= 32 * len(in_parts._levels)


def test_a_gap_is_not_bridged():
    octaves, jump = Octaves(1), np.concatenate([np.zeros(100), np.full(100, 1e3)])[None]
    octaves.add(jump[:, :100])
    octaves.add(jump[:, 100:], follows=False)
    assert not octaves.variances()[1].any()


def test_the_coefficients_are_those_that_were_simulated(found):
    for name, within in (("white_noise", 0.02), ("bias_instability", 0.35)):
        ratio = found.values[name] / TRUE[name]
        assert np.all(np.abs(ratio - 1.0) < within), (name, ratio)
    assert abs(float(np.mean(found.values["bias_instability"])) / TRUE["bias_instability"] - 1.0) < 0.15
    inside = [(found.low[name] <= value) & (value <= found.high[name] * (1 + 1e-12)) for name, value in TRUE.items()]
    # 18 intervals of 95 %: fewer than 15 of them would be chance in 1 of 1000
    assert np.sum(inside) >= 15


def test_intervals_hold_the_truth_at_their_rate():
    """Fit 40 rests at once, of coefficients that the octaves hardly separate."""
    truth, n = np.array([1.0, 0.35, 0.01]), 2**15
    octaves = Octaves(40)
    octaves.add(np.stack([noise(np.random.default_rng(seed), n, 1.0, *truth) for seed in range(40)]))
    sizes, variances, _ = octaves.variances()
    confidence = 0.68
    of = [fit_coefficients(sizes, each, n, 1.0, confidence) for each in variances.T]
    inside = np.mean([(one.low[:3] <= truth) & (truth <= one.high[:3]) for one in of])
    assert inside == pytest.approx(confidence, abs=2.5 * np.sqrt(confidence * (1.0 - confidence) / len(of)))
    values = np.mean([one.value[:3] for one in of], axis=0)
    np.testing.assert_allclose(values / truth, 1.0, atol=0.1)


def test_noise_is_compared_with_the_data_sheet(found):
    # 400 ug/sqrt(Hz), one-sided
    assert found.data_sheet["accelerometer"] == pytest.approx(2.774e-3, rel=1e-3)
    assert found.suspicious == ()


def test_tones_steps_and_temperature_changes_are_reported(lying):
    t = lying.t
    tone = 2e-2 * np.sin(2 * np.pi * 11.7 * t)
    acc, gyr = lying.acc.copy(), lying.gyr.copy()
    acc[:, 0] += tone
    gyr[len(t) // 2 :, 1] += 0.05
    warm = 25.0 + 6.0 * t / t[-1]
    gyr[:, 2] += 0.01 * warm
    noise_ = noise_of(replace(lying, acc=acc, gyr=gyr, temperature_c=warm))
    said = {row["code"]: row["message"] for row in noise_.suspicious}
    assert set(said) == {"tone", "step", "temperature"}
    assert "accelerometer x: a tone at 11.69 Hz" in said["tone"]
    assert "gyroscope y: a step of +0.04" in said["step"]
    assert "changed by 6.0 °C" in said["temperature"]
    assert "gyroscope z" in said["temperature"]


def test_a_board_that_was_turned_has_no_tones(lying):
    t, about_x = lying.t, np.radians(8.0)
    turned = (t > 300.0) & (t < 420.0)
    acc = lying.acc + 0.05 * np.sin(2 * np.pi * 11.7 * t)[:, None]
    acc[turned] = acc[turned] @ [
        [1, 0, 0],
        [0, np.cos(about_x), -np.sin(about_x)],
        [0, np.sin(about_x), np.cos(about_x)],
    ]
    (moved,) = noise_of(replace(lying, acc=acc)).suspicious
    assert moved["code"] == "moved"
    assert "the board was turned, gravity by 8 deg, from 30" in moved["message"]
    vehicle = replace(lying, acc=acc, sensor=replace(SENSOR, message="RAW_IMU"))
    assert noise_of(vehicle).suspicious[0]["message"] == moved["message"].replace("board", "vehicle")
    # half of it upside down: neither direction is the common one
    (moved,) = noise_of(replace(lying, acc=lying.acc * np.where(t < t.mean(), 1.0, -1.0)[:, None])).suspicious
    assert "gravity by 180 deg" in moved["message"]
    # a turn about the vertical does not change gravity
    gyr = lying.gyr.copy()
    gyr[turned, 2] += 0.1
    (moved,) = noise_of(replace(lying, gyr=gyr)).suspicious
    assert moved["code"] == "moved"


def test_the_time_still_needed_depends_on_the_accuracy(lying):
    meter = NoiseMeter(SENSOR, RATE_HZ)
    meter.add(lying.part(0, 100))
    assert meter.needed_s(0.01) is None
    meter.add(lying.part(100, 2**15))
    assert meter.needed_s(0.01) > meter.needed_s(0.02) > 0.0
    assert meter.needed_s(100.0) == 0.0


def test_a_file_is_read_as_it_was_written_and_no_other(found, tmp_path):
    found.save(tmp_path / "noise.json")
    assert Noise.load(tmp_path / "noise.json").document() == found.document()
    for text in ("[" * 10**5, '{"format": NaN}', '{"format": "mpucal.noise"}'):
        (tmp_path / "noise.json").write_text(text)
        with pytest.raises(mpucal.MpucalError, match="holds no noise"):
            Noise.load(tmp_path / "noise.json")
    with pytest.raises(mpucal.MpucalError, match="are too few to measure noise"):
        mpucal.noise(rest(2**10).part(0, 100))


def test_exports_hold_the_measured_noise(found):
    calibration = with_noise(
        mpucal.Calibration(
            np.eye(3),
            np.zeros(3),
            noise_std=np.full(3, 0.5),
            gyro_noise_std=np.full(3, 0.5),
            b_omega=np.zeros(3),
            quality={"verdict": "good"},
            sensor=SENSOR,
        ),
        found,
    )
    for name in ("kalibr", "openvins"):
        text, notes = form(name).export(calibration)
        values = dict(
            line.strip().split(": ") for line in text.splitlines() if "noise_density" in line and "#" not in line
        )
        assert float(values["accelerometer_noise_density"]) == pytest.approx(TRUE["white_noise"], rel=0.02)
        assert any("a rest of 21." in note for note in notes)
    text, _ = form("ros").export(calibration)
    row = next(line for line in text.splitlines() if line.startswith("angular_velocity_covariance"))
    assert json.loads(row.split(": ")[1])[0] == pytest.approx(TRUE["white_noise"] ** 2 * RATE_HZ, rel=0.05)
