"""Table of chips: identities, and a new chip by one row."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.chip import families
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.chip.families import FAMILIES, MPU6050, MPU6500, Part, WordGroup, part_of
from mpucal.errors import ChipError
from mpucal.simulated.chip import models, open_simulated


@pytest.mark.parametrize("who_am_i", [0x00, 0xFF, 0x72])
def test_an_unknown_identity_is_refused_with_the_known_ones(who_am_i):
    with pytest.raises(ChipError, match=rf"0x{who_am_i:02x}.*0x68 MPU-6050.*0x70 MPU-6500"):
        part_of(who_am_i)


@pytest.mark.parametrize(
    ("family", "count", "celsius"),
    [(MPU6050, -521, 35.0), (MPU6050, 0, 36.53), (MPU6500, 0, 21.0), (MPU6500, 333.87 * 4, 25.0)],
)
def test_temperature_formula(family, count, celsius):
    """Sources: RM-MPU-6000A register 65, whose example is 35 C at -521; PS-MPU-9250A table 3."""
    assert count / family.lsb_per_c + family.zero_c == pytest.approx(celsius, abs=0.01)


def test_a_new_chip_is_one_row(monkeypatch):
    """The simulated model and the driver both follow the row: frame, ranges, temperature, FIFO."""
    made_up = replace(
        MPU6500,
        name="MADE-UP",
        parts=((0x46, "MADE-UP"),),
        fifo_bytes=1536,
        lsb_per_c=100.0,
        zero_c=10.0,
        frame=(WordGroup.GYRO, WordGroup.TEMPERATURE, WordGroup.ACCEL),
        gyro_range_shift=2,
        asleep=True,
    )
    monkeypatch.setattr(families, "FAMILIES", (*FAMILIES, made_up))
    monkeypatch.setitem(families.PARTS, 0x46, Part("MADE-UP", 0x46, made_up))
    monkeypatch.setitem(models.MODELS, "made_up", models.Model("made_up", made_up))
    bus = open_simulated("sim:chip=made_up,seed=2,temperature_c=31,b_omega=0.1/0.2/-0.3,noise=0,hand=still")
    driver = Driver(bus, Config(gyro_range_dps=1000))
    assert driver.start().chip == "MADE-UP"
    for _ in range(20):
        driver.poll()
    recording = driver.recording()
    assert recording.temperature_c.mean() == pytest.approx(31, abs=0.1)
    assert np.linalg.norm(recording.acc, axis=1).mean() == pytest.approx(9.8, abs=1)
    np.testing.assert_allclose(recording.gyr.mean(0), [0.1, 0.2, -0.3], atol=0.03)
