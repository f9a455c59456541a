"""mpucal.load and mpucal.calibrate: their arguments checked, and a path taken where a recording is meant."""

from __future__ import annotations

from numbers import Real
from os import PathLike
from typing import Literal

from .arguments import a_path
from .calibration import calibrate as _calibrate
from .data import STANDARD_GRAVITY_MPS2, Recording
from .errors import WrongType, WrongValue
from .files import load as _load
from .files.hints import Hints, parse_columns, parse_units
from .result.calibration import Calibration

ModelName = Literal["auto", "hand", "imu", "accel", "paper", "tilt"]


def load(
    path: str | PathLike[str],
    *,
    topic: str | None = None,
    columns: str = "",
    units: str = "",
    accel_range: float | None = None,
    gyro_range: float | None = None,
    rate: float | None = None,
) -> Recording:
    """The recording in a file (.mcap, .tlog, .bin of ArduPilot, .npz, .csv), or in the folder of a session.

    A capture that was cut short gives what is whole of it, and says so in `recovered`. As what the columns and units of
    another program's file were taken is said in `taken`.

    Parameters
    ----------
    topic : of a bag. columns : of a table, "t=NAME,ax=NAME,..." or "t,ax,ay,az,gx,gy,gz".
    units : "t=ms,acc=g,gyr=deg/s".
    accel_range : g, gyro_range : deg/s, full scale of counts. rate : Hz, of samples without times.

    Raises
    ------
    RecordingError : no such file, one of another kind, no recording in it, or doubtful columns or units.
    CaptureError : a capture that cannot be read. ChipError : the capture of a chip that is not known.
    UsageError : something is said of a file of which nothing has to be said.
    WrongType : `path` is no path. WrongValue : no such columns or units.
    """
    try:
        hints = Hints(
            topic,
            parse_columns(columns) if columns else {},
            parse_units(units) if units else {},
            accel_range,
            gyro_range,
            rate,
        )
    except ValueError as error:
        raise WrongValue(str(error), "see docs/recordings.md") from error
    return _load(a_path(path, "a recording"), hints)


def calibrate(
    recording: Recording | str | PathLike[str],
    model: ModelName = "auto",
    gravity: float = STANDARD_GRAVITY_MPS2,
    gravity_anyway: bool = False,
) -> Calibration:
    """Estimate the accelerometer's D and b_a: y = D R(x) g + b_a + e (the paper's equation 3).

    A bad recording gives a calibration whose verdict is "refused", with reasons; nothing is raised for it.

    Parameters
    ----------
    recording : what was measured, first lying flat, then turned; or the path of its file.
    model : which parameters are estimated. gravity : m/s^2, the local ||g||.
    gravity_anyway : a gravity that no place on Earth has is meant, and no reason against the calibration.

    Raises
    ------
    WrongType : an argument of another type. WrongValue : no such model, or a gravity that is none.
    SourceError : the file holds no recording, see load.
    """
    if isinstance(recording, str | PathLike):
        recording = load(recording)
    if not isinstance(recording, Recording):
        what = "give a mpucal.Recording, as of mpucal.load or Recording.from_arrays, or the path of one"
        raise WrongType(f"{type(recording).__name__} is no recording", what)
    if not isinstance(gravity, Real) or isinstance(gravity, bool):
        raise WrongType(f"gravity is {gravity!r}", "give the local gravity in m/s^2, about 9.81")
    return _calibrate(recording, model, float(gravity), gravity_anyway)
