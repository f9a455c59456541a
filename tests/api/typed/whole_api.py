"""Everything that mpucal has in Python, used once, with the types that a checker must infer. It is never run."""

from pathlib import Path
from typing import assert_type

import numpy as np
import polars as pl
from matplotlib.figure import Figure
from numpy.typing import NDArray

import mpucal
from mpucal import Calibration, CheckResult, MpucalError, Noise, Recording

Vector = NDArray[np.float64]

recording = mpucal.load("board7/capture.mcap")
assert_type(recording, Recording)
assert_type(mpucal.load(Path("a.bag"), topic="/imu", units="t=ms", accel_range=4.0, rate=200), Recording)
t, acc, gyr = np.arange(9) / 9.0, np.zeros((9, 3)), np.zeros((9, 3))
arrays = Recording.from_arrays(t, acc, gyr, flat=(0, 3))
assert_type(arrays, Recording)
assert_type(Recording.from_dataframe(recording.to_dataframe("polars"), name="walk"), Recording)
assert_type(recording.part(0, 9), Recording)
assert_type(recording.t, Vector)
assert_type(recording.plot(), Figure)
assert_type(recording.sensor.chip, str | None)
assert_type(len(recording), int)

calibration = mpucal.calibrate(recording, model="hand", gravity=9.81)
assert_type(mpucal.calibrate("walk.csv"), Calibration)
assert_type(calibration.D, Vector)
assert_type(calibration.b_a_std, Vector)
assert_type(calibration.quality["error_std"]["rms"], float | None)
assert_type(calibration.quality["reasons"][0]["code"], str)
assert_type(calibration.fit["converged"], bool)
assert_type(calibration.inverse, Vector)
if calibration.verdict == "refused":
    raise SystemExit([reason.get("remedy") for reason in calibration.quality["reasons"]])

assert_type(calibration.apply(acc), Vector)
assert_type(calibration.apply([0.0, 0.0, 9.8], temperature_c=25.0), Vector)
assert_type(calibration.apply(acc, gyr), tuple[Vector, Vector])
assert_type(calibration.apply(pl.DataFrame()), pl.DataFrame)
assert_type(calibration.plot(recording), Figure)
assert_type(calibration.plot(), Figure)
assert_type(mpucal.check(calibration, "today.mcap", days=30.0), CheckResult)
assert_type(mpucal.noise("rest.csv"), Noise)
calibration.save("calibration.json")
try:
    assert_type(Calibration.load(Path("calibration.bin")), Calibration)
except MpucalError as error:
    print(error)
