"""mpucal.load, calibrate, check and noise: their arguments checked, and a path taken where a file is meant."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Literal

from .allan import noise_of
from .arguments import a_path, real
from .calibration import calibrate as _calibrate
from .data import STANDARD_GRAVITY_MPS2, Recording
from .errors import WrongType, WrongValue
from .files import load as _load
from .files.hints import Hints, parse_columns, parse_span, parse_units
from .recheck import check as _check
from .recheck.outcome import CheckResult as CheckResult  # noqa: PLC0414 - mpucal takes it from here
from .result.calibration import Calibration
from .result.clock import now
from .result.noise import Noise as Noise  # noqa: PLC0414

ModelName = Literal["auto", "hand", "imu", "accel", "paper", "tilt"]
UNITS = {"accel_range": "the full scale in g", "gyro_range": "the full scale in deg/s", "rate": "samples a second"}


def load(
    path: str | PathLike[str],
    *,
    topic: str | None = None,
    columns: str = "",
    units: str = "",
    accel_range: float | None = None,
    gyro_range: float | None = None,
    rate: float | None = None,
    span: str = "",
) -> Recording:
    """The recording in a file (.mcap, .tlog, .bin of ArduPilot, .npz, .csv), or in the folder of a session.

    A capture that was cut short gives what is whole of it, and says so in `recovered`. As what the columns and units of
    another program's file were taken is said in `taken`.

    Parameters
    ----------
    topic : of a bag. columns : of a table, "t=NAME,ax=NAME,..." or "t,ax,ay,az,gx,gy,gz".
    units : "t=ms,acc=g,gyr=deg/s".
    accel_range : g, gyro_range : deg/s, full scale of counts. rate : Hz, of samples without times.
    span : "FROM:TO", s since the first sample: what is read of it.

    Raises
    ------
    RecordingError : no such file, one of another kind, no recording in it, or doubtful columns or units.
    CaptureError : a capture that cannot be read. ChipError : the capture of a chip that is not known.
    UsageError : something is said of a file of which nothing has to be said.
    WrongType : `path` is no path, or a hint of another type. WrongValue : no such columns, units, range or rate.
    """
    for name, value in (("topic", topic), ("columns", columns), ("units", units), ("span", span)):
        if not isinstance(value, str | None):
            raise WrongType(f"{name} is {value!r}", "give it as text, see docs/recordings.md")
    scales = {"accel_range": accel_range, "gyro_range": gyro_range, "rate": rate}
    full_g, full_dps, hz = (
        None if value is None else real(value, name, UNITS[name], least=1e-9) for name, value in scales.items()
    )
    try:
        said = parse_columns(columns) if columns else {}, parse_units(units) if units else {}
        hints = Hints(topic, *said, full_g, full_dps, hz, parse_span(span) if span else None)
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
    recording = recording_of(recording)
    local = real(gravity, "gravity", "the local gravity in m/s^2, about 9.81")
    return _calibrate(recording, model, local, gravity_anyway)


def check(
    calibration: Calibration | str | PathLike[str],
    recording: Recording | str | PathLike[str],
    days: float | None = None,
) -> CheckResult:
    """Whether a calibration is still right for the sensor that made a recording.

    A sensor to which nothing happened is called changed in 1 of 100 checks, see docs/check.md.

    Parameters
    ----------
    calibration : the one to check, or the path of its file. recording : first lying flat, then still in three other
        orientations or more, 20 deg apart; or the path of its file.
    days : from the calibration to the recording; None: by their dates.

    Returns
    -------
    CheckResult : `verdict` is still good, drifted, remounted, another sensor, or cannot be told; `changes` holds what
        changed, with standard deviations.

    Raises
    ------
    WrongType, WrongValue : an argument of another type, or days before the calibration. UsageError : a calibration that
        was refused, or of another kind of samples.
    SourceError : a file holds no calibration, or no recording.
    """
    if isinstance(calibration, str | PathLike):
        calibration = Calibration.load(Path(calibration))
    if not isinstance(calibration, Calibration):
        what = "give a mpucal.Calibration, as of mpucal.calibrate, or the path of one"
        raise WrongType(f"{type(calibration).__name__} is no calibration", what)
    between = None if days is None else real(days, "days", "how many lie between both", least=0.0)
    return _check(calibration, recording_of(recording), between)


def noise(recording: Recording | str | PathLike[str]) -> Noise:
    """The noise of a sensor that lies still, by its overlapping Allan deviation, see docs/noise.md.

    Parameters
    ----------
    recording : a rest of minutes to hours, or the path of its file.

    Returns
    -------
    Noise : white noise, bias instability, random walk and quantisation of the six axes, with 95 % intervals.

    Raises
    ------
    WrongType : an argument of another type. RecordingError : too few samples.
    """
    return noise_of(recording_of(recording), now().isoformat())


def recording_of(given: Recording | str | PathLike[str]) -> Recording:
    """A recording, or that of a path.

    Raises
    ------
    WrongType : it is neither. SourceError : see load.
    """
    if isinstance(given, str | PathLike):
        given = load(given)
    if not isinstance(given, Recording):
        what = "give a mpucal.Recording, as of mpucal.load or Recording.from_arrays, or the path of one"
        raise WrongType(f"{type(given).__name__} is no recording", what)
    return given
