"""Records of a write in the result files."""

from dataclasses import replace

import numpy as np

from mpucal.result.calibration import Calibration
from mpucal.sinks.record import session_recorder
from mpucal.sinks.table import SINKS

BIAS = np.array([0.3, -0.2, 1.0])
GOOD = {"verdict": "good", "reasons": []}


def test_what_was_measured_stays_where_another_stream_comes_now(tmp_path):
    measured = Calibration(np.eye(3), BIAS, quality=GOOD)
    now = replace(measured, D=2 * np.eye(3), extra={"written": [{"to": "autopilot"}]})
    held = session_recorder(tmp_path, measured, None, None)(SINKS["autopilot"], now)
    assert np.array_equal(held.D, measured.D)
    assert held.extra["written"] == [{"to": "autopilot"}]
    assert np.array_equal(Calibration.load(tmp_path / "calibration.json").D, measured.D)
    assert np.array_equal(Calibration.load(tmp_path / "calibration-on-autopilot.json").D, now.D)
