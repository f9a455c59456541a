"""`mpucal show` of devices, and of what is applied where."""

import json
from dataclasses import replace

import numpy as np
import pytest

from mpucal.result.calibration import Calibration


@pytest.mark.parametrize("chip", ["mpu6050", "mpu6500"])
def test_a_chip_is_shown_as_it_is(mpucal, chip):
    shown = json.loads(mpucal("show", "--bus", f"sim:seed=3,chip={chip}", "--json").out)
    assert shown["chip"].lower().replace("-", "") == chip
    assert shown["accel_range_g"] == 2
    place = {"mpu6050": "0x06", "mpu6500": "0x77"}[chip]
    # the factory's trim
    assert any(shown["accel_offsets"][place])
    page = mpucal("show", "--bus", f"sim:seed=3,chip={chip}").out
    assert f"WHO_AM_I 0x{shown['who_am_i']:02x}" in page
    assert str(shown["accel_offsets"][place][0]) in page


def test_a_vehicles_parameters_are_shown(mpucal):
    shown = json.loads(mpucal("show", "--mavlink", "sim", "--json").out)
    assert shown["firmware"] == "ArduPilot"
    assert "INS_ACCOFFS_X" in shown["parameters"]
    assert "INS_ACCOFFS_X" in mpucal("show", "--mavlink", "sim").out


@pytest.mark.parametrize("words", [(), ("x.json", "--bus", "sim"), ("--bus", "sim", "--mavlink", "sim")])
def test_one_thing_is_shown(mpucal, words):
    assert mpucal("show", *words).code == 2


def test_what_is_applied_is_said_and_not_subtracted_again(mpucal, tmp_path):
    b_a = np.array([0.25, -0.5, 0.75])
    entry = {"to": "chip", "where": "the chip", "what": "the registers subtract it", "at": "2024-05-17T09:30:00+00:00"}
    made = Calibration(np.eye(3), b_a, applied_in_hardware=b_a, extra={"written": [entry]})
    sloped = replace(
        made,
        b_a_slope=np.array([0.01, 0.0, -0.02]),
        temperature_range_c=np.array([10.0, 40.0]),
        sensor=replace(made.sensor, temperature_c=25.0),
    )
    sloped.save(tmp_path / "c.json")
    out = mpucal("show", "c.json").out
    assert "subtract (+25.5, -51.0, +76.5) mg of b_a" in out
    assert "Written at 2024-05-17T09:30:00+00:00: the registers subtract it." in out
    assert "b_a changes by (+1.020, +0.000, -2.039) mg/°C" in out
    assert "y_x -0.00000" in out or "y_x +0.00000" in out
