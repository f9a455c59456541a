"""A session on each kind of chip that is claimed: the right name and temperature, and a good calibration."""

import json

import numpy as np
import pytest

from mpucal.__main__ import run

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
