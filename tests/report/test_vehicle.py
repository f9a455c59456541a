import re
from dataclasses import replace
from types import MappingProxyType

import pytest

from mpucal.report import render

OLD = {"INS_ACCOFFS_X": 0.001, "INS_ACCSCAL_X": 1.001, "AHRS_ORIENTATION": 0.0}
NEW = {"INS_ACCOFFS_X": 0.3165196, "INS_ACCSCAL_X": 0.9726794, "INS_ACCOFFS_Y": -0.5}


@pytest.fixture
def page(result):
    autopilot = {"firmware": "ArduPilot <4>", "params_old": OLD, "params_new": NEW, "residual_mps2": 0.109}
    reasons = [{"code": "few_orientations", "message": "too little was turned"}]
    other = {**result.document, "autopilot": autopilot, "quality": {"verdict": "usable", "reasons": reasons}}
    extra = MappingProxyType({"autopilot": autopilot, "others": [other]})
    return render(replace(result.calibration, extra=extra))


def test_parameters_stand_beside_what_they_were(page):
    rows = re.findall(r'<tr><th scope="row">INS_(\w+)</th><td>(.*?)</td><td>(.*?)</td></tr>', page)
    once = [("ACCOFFS_X", "0.001", "0.31652"), ("ACCSCAL_X", "1.001", "0.972679"), ("ACCOFFS_Y", "unknown", "-0.5")]
    assert rows == once * 2
    assert "AHRS_ORIENTATION" not in page
    assert "ArduPilot &lt;4&gt;" in page
    assert "0.11 m/s² rms" in page


def test_each_other_imu_is_there_with_its_verdict(page):
    assert "MPU-6050: usable" in page
    assert "too little was turned." in page
    assert page.count('<table id="accelerometer') == 2


def test_a_sensor_by_itself_has_no_vehicle(result):
    assert "The vehicle" not in result.html
