"""`mpucal noise` of a recording and of a sensor, and its result in other commands."""

import json

import numpy as np
import pytest

from mpucal.data import Recording, Sensor
from mpucal.result.noise import FORMAT
from tools.lab.scenarios.noise import noise


@pytest.fixture
def lying(save, tmp_path):
    """A file of three minutes at rest, its white noise 2e-3 m/s^2/sqrt(Hz) and 1e-4 rad/s/sqrt(Hz)."""
    rng = np.random.default_rng(0)
    six = [noise(rng, 18_000, 100.0, white, 0.0, 0.0) for white in 3 * (2e-3,) + 3 * (1e-4,)]
    acc, gyr = np.stack(six[:3], axis=1) + np.array([0.0, 0.0, 9.8]), np.stack(six[3:], axis=1)
    sensor = Sensor(chip="MPU-6050", rate_hz=100.0)
    return save(Recording.from_arrays(np.arange(18_000) / 100.0, acc, gyr, sensor=sensor), tmp_path / "lying.npz")


def test_noise_of_a_recording_is_used_by_other_commands(mpucal, session, lying, tmp_path):
    done = mpucal("noise", "lying.npz", "-o", "noise", code=0)
    assert "white noise, ug/√Hz" in done.out
    assert "data sheet:" in done.out
    page = (tmp_path / "noise" / "noise.html").read_text()
    assert "<h1>Noise of MPU-6050</h1>" in page
    document = json.loads((tmp_path / "noise" / "noise.json").read_text())
    assert document["format"] == FORMAT
    assert document["accelerometer"]["white_noise"]["value"] == pytest.approx([2e-3] * 3, rel=0.05)

    calibration = session.folder / "calibration.json"
    exported = mpucal("export", calibration, "--to", "kalibr", "--noise", "noise/noise.json", code=0)
    density = next(line for line in exported.out.splitlines() if line.startswith("gyroscope_noise_density"))
    assert float(density.split(": ")[1]) == pytest.approx(1e-4, rel=0.05)

    fitted = json.loads(mpucal("calibrate", session.folder, "--noise", "noise/noise.json", "--json").out)
    assert fitted["noise"]["accelerometer"]["white_noise"] == pytest.approx(2e-3, rel=0.05)
    assert fitted["quality"]["verdict"] == "good"


def test_noise_of_a_sensor_over_hours(mpucal):
    done = mpucal("noise", "--bus", "sim", "--rate", "100", "--hours", "0.01", "--json", code=0)
    assert "let go of it" in done.err
    document = json.loads(done.out)
    assert 36.0 <= document["seconds"] < 38.0
    # The trembling hand has put the board down before.
    assert document["suspicious"] == []
    assert (
        max(document["accelerometer"]["white_noise"]["value"])
        < 2 * document["accelerometer"]["data_sheet"]["white_noise"]
    )
    assert document["accelerometer"]["data_sheet"]["white_noise"] == pytest.approx(2.77e-3, rel=0.01)


def test_noise_of_a_vehicle_asks_for_a_vehicle_to_be_put_down(mpucal):
    done = mpucal("noise", "--mavlink", "sim:imus=1", "--hours", "0.003", "--json", code=0)
    assert "Put the vehicle on a firm surface" in done.err
    assert "board" not in done.err


def test_noise_after_ctrl_c_is_that_of_the_samples_so_far(mpucal, monkeypatch):
    from mpucal.allan import NoiseMeter

    add, calls = NoiseMeter.add, []

    def interrupted(meter, samples):
        add(meter, samples)
        calls.append(len(samples))
        if len(calls) == 10:
            raise KeyboardInterrupt

    monkeypatch.setattr(NoiseMeter, "add", interrupted)
    done = mpucal("noise", "--bus", "sim:hand=still", "--rate", "100", "--json", code=0)
    assert json.loads(done.out)["samples"] == sum(calls)


def test_noise_of_a_sensor_that_fails_is_that_of_the_samples_so_far(mpucal):
    done = mpucal("noise", "--bus", "sim:hand=still,fault=unplugged@20", "--rate", "100", "--json", code=3)
    assert 10.0 < json.loads(done.out)["seconds"] < 20.0
    assert "mpucal: nothing answers at 0x68" in done.err
    assert "; the noise is that of the 1" in done.err
