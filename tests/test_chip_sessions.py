"""Each kind of chip that is claimed gives a good calibration; tests of tools/lab show the name of each part.

Sessions on chips of three families are in test_session_replay.py and cli/test_session.py.
"""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import mpucal
from mpucal.__main__ import run
from mpucal.calibration import calibrate
from mpucal.calibration.hand import fit_hand
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.rests.flat import find_flat, flat_statistics
from mpucal.session.events import Prompt, PromptKind
from mpucal.simulated.chip import open_simulated

# one of each behaviour; a part that differs by its identity alone is left out
CHIPS = {
    "mpu6500": "MPU-6500",
    "mpu6500_512": "MPU-6500",
    "mpu6880": "MPU-6880",
    "clone98": "ICM-20689",
    "icm20690": "ICM-20690",
    "icm20602": "ICM-20602",
    "mpu6886": "MPU-6886",
    "mpu6050,fault=no_fifo": "MPU-6050",
}
TURNED = ("icm20690", "mpu6050,fault=no_fifo")
FLAT_S, TURNED_S = 12.0, 75.0


@cache
def turned(chip):
    """A recording of the chip in a hand that turns it as it likes, and the D that it has."""
    bus = open_simulated(f"sim:seed=3,hand=random,chip={chip},temperature_c=27")
    driver = Driver(bus, Config(rate_hz=50, poll_s=0.25))
    driver.start()
    for kind, until_s in ((PromptKind.LAY_FLAT, FLAT_S), (PromptKind.ROTATE, TURNED_S)):
        bus.hear(Prompt(kind, ""))
        while driver.now_ns() < until_s * 1e9:
            driver.poll()
    return driver.recording(), np.array(bus.truth_document()["D"])


# the others differ from these by what tests/chip shows: identity, ranges, size of the FIFO
@pytest.mark.parametrize(
    "chip", [name if name in TURNED else pytest.param(name, marks=pytest.mark.slow) for name in CHIPS]
)
def test_each_chip_is_named_and_its_calibration_is_good(chip):
    recording, D = turned(chip)
    assert recording.sensor.chip == CHIPS[chip]
    assert recording.temperature_c.mean() == pytest.approx(27, abs=0.3)
    assert not recording.gap.any()
    found = calibrate(recording, model="hand")
    assert found.verdict == "good"
    assert np.abs(found.D - D).max() < 3e-3


@pytest.mark.slow
def test_a_session_without_a_fifo_is_replayed_to_the_bit(tmp_path, capsys):
    def session(*words):
        run(["session", *words, "--yes", "--json", "--json-events"])
        return {key: value for key, value in json.loads(capsys.readouterr().out).items() if key != "created"}

    made = tmp_path / "made"
    words = ["--bus", "sim:fault=no_fifo/nack@9", "--seed", "4", "--rate", "25", "--target", "quick", "--model", "hand"]
    found = session(*words, "-o", str(made))
    assert session("--replay", str(made), "-o", str(tmp_path / "again")) == found
    assert [reason["code"] for reason in found["quality"]["reasons"]] == ["data_lost"]
    assert mpucal.load(made / "capture.mcap").gap.sum() == 1


@pytest.mark.slow
def test_the_filters_of_a_6500_are_found_and_told():
    """The gyroscope is a millisecond later than its accelerometer, and the estimate is drawn towards that."""

    def fitted(recording, **told):
        recording = replace(recording, sensor=replace(recording.sensor, **told))
        return fit_hand(recording, flat_statistics(recording, find_flat(recording)), 9.80665)

    (of_6050, _), (of_6500, _) = turned("mpu6050"), turned("mpu6500")
    assert fitted(of_6500).delay_s - fitted(of_6050).delay_s == pytest.approx(-1e-3, abs=2e-4)
    drawn = fitted(of_6500).delay_s - fitted(of_6500, accel_lag_s=0.0).delay_s
    assert -3e-4 < drawn < -1e-5
