"""A real result: the replayed session's recording, its calibration.json, and the page that goes with them."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import mpucal
from mpucal.report import render

CAPTURE = Path(__file__).parents[2] / "fixtures" / "sessions" / "mpu6050.mcap"


@dataclass(frozen=True)
class Result:
    """A recording, its calibration, the document and the page."""

    recording: Any
    calibration: Any
    document: dict[str, Any]
    html: str


@pytest.fixture(scope="session")
def result(tmp_path_factory):
    recording = mpucal.load(CAPTURE)
    calibration = mpucal.calibrate(recording)
    path = tmp_path_factory.mktemp("result") / "calibration.json"
    calibration.save(path)
    document = json.loads(path.read_text(encoding="utf-8"))
    return Result(recording, calibration, document, render(calibration, recording))
