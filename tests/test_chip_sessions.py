"""A session on each kind of chip that is claimed: the right name and temperature, and a good calibration."""

import json
from dataclasses import replace

import numpy as np
import pytest

import mpucal
from mpucal.__main__ import run
from mpucal.calibration.flat_segment import find_flat, flat_statistics
from mpucal.calibration.hand import fit_hand
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.session.events import Prompt, PromptKind
from mpucal.simulated.chip import open_simulated

CHIPS = {
    "mpu6500": "MPU-6500",
    "mpu6500_512": "MPU-6500",
    "mpu9250": "MPU-9250",
    "mpu6880": "MPU-6880",
    "clone98": "ICM-20689",
    "icm20609": "ICM-20609",
    "icm20690": "ICM-20690",
    "icm20602": "ICM-20602",
    "mpu6886": "MPU-6886",
    "mpu6050,fault=no_fifo": "MPU-6050",
}


@pytest.mark.parametrize("chip", CHIPS)
def test_a_session_on_each_chip_ends_good(chip, tmp_path, capsys):
    words = ["session", "--bus", f"sim:chip={chip},temperature_c=27", "--seed", "4", "--rate", "50"]
    run([*words, "--model", "hand", "-o", str(tmp_path / "s"), "--yes", "--json", "--json-events"])
    found = json.loads(capsys.readouterr().out)
    truth = json.loads((tmp_path / "s" / "truth.json").read_text())
    assert found["quality"]["verdict"] == "good"
    assert found["sensor"]["chip"] == CHIPS[chip]
    assert found["sensor"]["temperature_c"] == pytest.approx(27, abs=0.3)
    error = np.abs(np.array(found["accelerometer"]["D"]) - truth["D"])
    assert error.max() < 2e-3


def test_a_session_without_a_fifo_is_replayed_to_the_bit(tmp_path, capsys):
    def session(*words):
        run(["session", *words, "--yes", "--json", "--json-events"])
        return {key: value for key, value in json.loads(capsys.readouterr().out).items() if key != "created"}

    made = tmp_path / "made"
    words = ["--bus", "sim:fault=no_fifo/nack@9", "--seed", "4", "--rate", "50", "--model", "hand"]
    found = session(*words, "-o", str(made))
    assert session("--replay", str(made), "-o", str(tmp_path / "again")) == found
    assert [reason["code"] for reason in found["quality"]["reasons"]] == ["data_lost"]
    assert mpucal.load(made / "capture.mcap").gap.sum() == 1


def test_the_filters_of_a_6500_are_found_and_told():
    """Its gyroscope is a millisecond later than its accelerometer, and the estimate is drawn towards that."""

    def turned(chip):
        bus = open_simulated(f"sim:seed=3,hand=random,chip={chip}")
        driver = Driver(bus, Config(rate_hz=50))
        driver.start()
        for kind, until_s in ((PromptKind.LAY_FLAT, 12), (PromptKind.ROTATE, 75)):
            bus.hear(Prompt(kind, ""))
            while driver.now_ns() < until_s * 1e9:
                driver.poll()
        return driver.recording()

    def fitted(recording, **told):
        recording = replace(recording, sensor=replace(recording.sensor, **told))
        return fit_hand(recording, flat_statistics(recording, find_flat(recording)), 9.80665)

    of_6050, of_6500 = turned("mpu6050"), turned("mpu6500")
    assert fitted(of_6500).delay_s - fitted(of_6050).delay_s == pytest.approx(-1e-3, abs=2e-4)
    drawn = fitted(of_6500).delay_s - fitted(of_6500, accel_lag_s=0.0).delay_s
    assert -3e-4 < drawn < -1e-5
