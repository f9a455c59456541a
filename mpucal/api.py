"""The public functions mpucal.load, calibrate, check and noise, which check their arguments and accept paths."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from .allan import noise_of
from .arguments import check_number, check_path
from .calibration import calibrate as _calibrate
from .data import STANDARD_GRAVITY_MPS2, Recording
from .errors import WrongType, WrongValue
from .files import load as _load
from .files.hints import Hints, parse_columns, parse_span, parse_units
from .recheck import check as _check
from .recheck.outcome import CheckResult as CheckResult  # noqa: PLC0414 - exported by mpucal
from .result.calibration import Calibration
from .result.clock import iso_utc
from .result.keys import Model
from .result.noise import Noise as Noise  # noqa: PLC0414

UNITS = {"accel_range": "the full scale in g", "gyro_range": "the full scale in deg/s", "rate": "the sample rate in Hz"}


def load(
    path: str | PathLike[str],
    *,
    topic: str | None = None,
    sensor: str | None = None,
    columns: str = "",
    units: str = "",
    accel_range: float | None = None,
    gyro_range: float | None = None,
    rate: float | None = None,
    span: str = "",
) -> Recording:
    """Return the recording in a file (.mcap, .tlog, .bin of ArduPilot, .npz, .csv), or in the folder of a session.

    Of a capture that was cut short, the whole part is read, and `recovered` says so. `taken` says how the columns and
    units of another program's file were read.

    Parameters
    ----------
    topic : of a bag. sensor : of a table of several, what its lines or columns call it.
    columns : of a table, "t=NAME,ax=NAME,..." or "t,ax,ay,az,gx,gy,gz".
    units : "t=ms,acc=g,gyr=deg/s".
    accel_range : g, gyro_range : deg/s, full scale of counts. rate : Hz, of samples without times.
    span : "FROM:TO", s since the first sample: the part to read.

    Raises
    ------
    RecordingError : there is no such file, it holds no recording, or its columns or units are doubtful.
    CaptureError : a capture that cannot be read. ChipError : a capture of an unknown chip.
    UsageError : a hint for a file that needs none.
    WrongType : `path` is not a path, or a hint has another type. WrongValue : impossible columns, units, range or rate.
    """
    for name, value in (("topic", topic), ("sensor", sensor), ("columns", columns), ("units", units), ("span", span)):
        if not isinstance(value, str | None):
            raise WrongType(f"{name} is {value!r}", "give text; see docs/recordings.md")
    scales = {"accel_range": accel_range, "gyro_range": gyro_range, "rate": rate}
    full_g, full_dps, hz = (
        None if value is None else check_number(value, name, UNITS[name], least=1e-9) for name, value in scales.items()
    )
    try:
        named = parse_columns(columns) if columns else {}, parse_units(units) if units else {}
        hints = Hints(topic, sensor, *named, full_g, full_dps, hz, parse_span(span) if span else None)
    except ValueError as error:
        raise WrongValue(str(error), "see docs/recordings.md") from error
    return _load(check_path(path, "a recording"), hints)


def calibrate(
    recording: Recording | str | PathLike[str],
    model: Model = "auto",
    gravity: float = STANDARD_GRAVITY_MPS2,
    gravity_anyway: bool = False,
) -> Calibration:
    """Estimate the accelerometer's D and b_a: y = D R(x) g + b_a + e (the paper's equation 3).

    A bad recording gives a calibration whose verdict is "refused", with reasons; nothing is raised for it.

    Parameters
    ----------
    recording : of a board that first lies flat and is then turned; or the path of its file.
    model : the set of parameters to estimate. gravity : m/s^2, the local ||g||.
    gravity_anyway : accept a gravity outside the range found on Earth.

    Raises
    ------
    WrongType : an argument of another type. WrongValue : an unknown model, or an impossible gravity.
    SourceError : the file holds no recording, see load.
    """
    recording = recording_of(recording)
    local = check_number(gravity, "gravity", "the local gravity in m/s^2, about 9.81")
    return _calibrate(recording, model, local, gravity_anyway)


def check(
    calibration: Calibration | str | PathLike[str],
    recording: Recording | str | PathLike[str],
    days: float | None = None,
) -> CheckResult:
    """Check whether a calibration is still valid for the sensor of a recording.

    An unchanged sensor is called changed in 1 of 100 checks; see docs/check.md.

    Parameters
    ----------
    calibration : the one to check, or the path of its file. recording : of a board that first lies flat and is
        then held still in three or more other orientations, 20 deg apart; or the path of its file.
    days : between calibration and recording; None: by their dates.

    Returns
    -------
    CheckResult : `verdict` is still good, drifted, remounted, another sensor, or cannot be told; `changes` holds the
        changes with standard deviations.

    Raises
    ------
    WrongType, WrongValue : an argument of another type, or days before the calibration. UsageError : the
        calibration was refused, or is of other samples.
    SourceError : a file holds no calibration, or no recording.
    """
    if isinstance(calibration, str | PathLike):
        calibration = Calibration.load(Path(calibration))
    if not isinstance(calibration, Calibration):
        remedy = "give a mpucal.Calibration, such as the result of mpucal.calibrate, or the path of one"
        raise WrongType(f"{type(calibration).__name__} is not a calibration", remedy)
    between = None if days is None else check_number(days, "days", "the days between both", least=0.0)
    return _check(calibration, recording_of(recording), between)


def noise(recording: Recording | str | PathLike[str]) -> Noise:
    """Return the noise of a sensor at rest, from its overlapping Allan deviation; see docs/noise.md.

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
    return noise_of(recording_of(recording), iso_utc())


def recording_of(given: Recording | str | PathLike[str]) -> Recording:
    """Return a recording, or load it from a path.

    Raises
    ------
    WrongType : it is neither. SourceError : see load.
    """
    if isinstance(given, str | PathLike):
        given = load(given)
    if not isinstance(given, Recording):
        remedy = (
            "give a mpucal.Recording, such as the result of mpucal.load or Recording.from_arrays, or the path of one"
        )
        raise WrongType(f"{type(given).__name__} is not a recording", remedy)
    return given
