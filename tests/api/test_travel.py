"""Calibrations and recordings pickled, copied, compared, and sent to other processes."""

import json
import pickle
from concurrent.futures import ProcessPoolExecutor
from copy import copy, deepcopy
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

import mpucal
from mpucal.data import Autopilot

CAPTURE = Path(__file__).parents[2] / "fixtures" / "sessions" / "mpu6500.mcap"
WAYS = {
    "pickle": lambda value: pickle.loads(pickle.dumps(value)),
    "copy": copy,
    "deepcopy": deepcopy,
}


@pytest.fixture(scope="module")
def recording():
    return mpucal.load(CAPTURE)


@pytest.fixture(scope="module")
def calibration(recording):
    return mpucal.calibrate(recording, "accel")


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_they_arrive_as_they_were(way, recording, calibration):
    imu = replace(recording, autopilot=Autopilot("PX4", 1, "HIGHRES_IMU", {"a": 1.0}), others=(recording,))
    assert [way(value) for value in (imu, calibration)] == [imu, calibration]


def test_they_differ_by_a_single_value(recording, calibration):
    acc = recording.acc.copy()
    acc[7, 1] = np.nextafter(acc[7, 1], 99.0)
    assert recording != replace(recording, acc=acc)
    assert recording != replace(recording, name="another")
    assert calibration != replace(calibration, b_a=np.nextafter(calibration.b_a, 99.0))
    assert calibration != replace(calibration, quality={**calibration.quality, "verdict": "usable"})
    assert calibration != "calibration"


def test_they_have_no_hash(recording, calibration):
    for value in (recording, calibration):
        with pytest.raises(TypeError, match="unhashable"):
            hash(value)


def test_its_mappings_are_those_of_the_document_and_do_not_change(calibration):
    assert json.loads(json.dumps(calibration.fit)) == calibration.document()["fit"]
    for change in (
        lambda fit: fit.update(model="imu"),
        lambda fit: fit.pop("model"),
        lambda fit: fit.__setitem__("model", "imu"),
        lambda fit: fit.__delitem__("model"),
        lambda fit: fit.__ior__({"model": "imu"}),
    ):
        with pytest.raises(TypeError, match="cannot be changed"):
            change(calibration.fit)
    assert {**calibration.fit, "model": "imu"}["model"] == "imu"


def test_a_pool_of_processes_calibrates_as_this_process_does(recording, calibration):
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        there = pool.submit(mpucal.calibrate, recording, "accel").result()
    assert replace(there, created=calibration.created) == calibration
