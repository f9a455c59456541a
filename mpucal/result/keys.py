"""Keys of calibration.json: the one table of their types, shapes and meanings; and the immutable dict for mappings.

`python -m tools.make pages` makes the published schema from it, calibration.schema.json, by which files are checked,
and the table of docs/reference/calibration.md. document.py reads and writes the arrays by it. `Annotated` holds the
shape of an array, further keywords of JSON Schema, and the meaning. A file must have the keys that are `Required`.

mpucal writes all keys of `Fit` and `Quality` but those that are `NotRequired`. From a config blob `quality` is empty,
and `fit` has the gravity alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import (
    Annotated,
    Any,
    Literal,
    NamedTuple,
    NoReturn,
    NotRequired,
    Required,
    TypedDict,
    get_args,
    get_origin,
    get_type_hints,
)

from ..data import Sensor
from ..reasons import ReadOnly, ReasonFound

FORMAT = "mpucal.calibration"
VERSION = 1
ACCELEROMETER_FORMULA, GYROSCOPE_FORMULA = "a = inv(D) @ (y - b_a)", "w = K @ (y - b_omega)"

Verdict = Literal["good", "usable", "refused"]
Model = Literal["auto", "hand", "imu", "accel", "tilt", "static", "paper"]
Number = float | None  # NaN or None (null in the file) if unknown
Parameters = Mapping[str, Number]
Vector3 = Annotated[Sequence[Number], (3,)]
Matrix = Annotated[Sequence[Sequence[Number]], (3, 3)]


class FrozenDict(dict[str, Any]):
    """Dict that cannot be changed (TypeError); unlike a mapping proxy it can be pickled, copied and dumped as JSON."""

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        raise TypeError("this mapping cannot be changed: make a dict of it")

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[type[FrozenDict], tuple[dict[str, Any]]]:
        # pickle would set the items one by one
        return FrozenDict, (dict(self),)


class Accelerometer(TypedDict, total=False):
    """The accelerometer's parameters; b_a(T) is written only if it is known."""

    D: Required[Annotated[Matrix, "scale factors and cross-coupling of y = D a + b_a"]]
    b_a: Required[Annotated[Vector3, "bias, m/s^2"]]
    D_std: Annotated[Matrix, "standard uncertainties of D"]
    b_a_std: Annotated[Vector3, "standard uncertainties of b_a, m/s^2"]
    noise_std: Annotated[Vector3, "noise of a sample, m/s^2 (1 sigma)"]
    formula: Annotated[str, {"const": ACCELEROMETER_FORMULA}]
    b_a_slope: Annotated[Vector3, "slope of b_a(T) from sensor.temperature_c on, m/s^2 per degree Celsius"]
    b_a_slope_std: Annotated[Vector3, "standard uncertainties of b_a_slope"]
    temperature_range_c: Annotated[Sequence[Number], (2,), "range in which b_a(T) was measured, degrees Celsius"]


class Gyroscope(TypedDict, total=False):
    """The gyroscope's parameters."""

    K: Annotated[Matrix, "scale factors and cross-coupling of w = K (y - b_omega)"]
    b_omega: Annotated[Vector3, "bias, rad/s"]
    K_std: Annotated[Matrix, "standard uncertainties of K"]
    b_omega_std: Annotated[Vector3, "standard uncertainties of b_omega, rad/s"]
    noise_std: Annotated[Vector3, "noise of a sample, rad/s (1 sigma)"]
    formula: Annotated[str, {"const": GYROSCOPE_FORMULA}]


class Hardware(TypedDict, total=False):
    """Part of b_a that the chip's offset registers subtract."""

    b_a: Annotated[Vector3, "m/s^2 that the offset registers subtract already"]


class Magnitude(TypedDict):
    """Statistics of |a| over all samples [m/s^2]."""

    median: ReadOnly[Number]
    mean: ReadOnly[Number]
    std: ReadOnly[Number]


class ErrorStd(TypedDict):
    """Standard uncertainty of a calibrated measurement over all directions [m/s^2, deg], and its parts."""

    rms: ReadOnly[Annotated[Number, "of a calibrated measurement over all directions, m/s^2"]]
    magnitude: ReadOnly[Annotated[Number, "of |a|, m/s^2"]]
    direction_deg: ReadOnly[Annotated[Number, "of the direction, deg"]]
    model: ReadOnly[Annotated[Number, "part of the model's own uncertainty, m/s^2"]]
    time: ReadOnly[Annotated[Number, "part of effects of time, m/s^2"]]
    side: ReadOnly[Annotated[Number, "part of a nonlinear accelerometer, m/s^2"]]
    change: ReadOnly[Annotated[Number, "part of a change of the sensor, m/s^2"]]
    decided_by: ReadOnly[Annotated[Literal["model", "time", "side", "change"] | None, "the largest part"]]


class Verification(TypedDict):
    """Result of the verification in new orientations."""

    agrees: ReadOnly[Annotated[bool | None, "null: too few orientations were shown"]]
    orientations: ReadOnly[Annotated[Sequence[Mapping[str, Any]], "errors in each, with predicted uncertainties"]]


class Quality(TypedDict):
    """Mapping `quality` of calibration.json; `verification` only after a session's verification."""

    verdict: ReadOnly[Verdict]
    reasons: ReadOnly[Annotated[Sequence[ReasonFound], "against the calibration, see the page of the reasons"]]
    magnitude_before: ReadOnly[Annotated[Magnitude, "|a| of all samples as measured, m/s^2"]]
    magnitude_after: ReadOnly[Annotated[Magnitude, "|a| of all samples as calibrated, m/s^2"]]
    error_std: ReadOnly[Annotated[ErrorStd, "standard uncertainty of a calibrated measurement"]]
    verification: NotRequired[ReadOnly[Annotated[Verification, "result of the verification in new orientations"]]]


class Fit(TypedDict):
    """Mapping `fit` of calibration.json: the model, the reason for its choice, and the course of the estimation."""

    model: ReadOnly[Annotated[str, {"enum": [*get_args(Model)]}, "parameters that were estimated (`--model`)"]]
    why: ReadOnly[Annotated[str, "why this model was chosen"]]
    parameters: ReadOnly[Annotated[int, "number of estimated parameters"]]
    iterations: ReadOnly[int]
    converged: ReadOnly[bool]
    nis: ReadOnly[Annotated[Number, "mean normalised innovation squared; 3 is expected"]]
    gravity: ReadOnly[Annotated[Number, "local gravity, m/s^2, to which the scale factors refer"]]
    gravity_anyway: NotRequired[ReadOnly[Annotated[bool, "a gravity outside the range found on Earth was confirmed"]]]
    samples: ReadOnly[Annotated[int, "number of samples"]]
    seconds: ReadOnly[Annotated[Number, "length of the recording, s"]]
    recording_digest: ReadOnly[Annotated[str, "SHA-256 of the samples, to know the recording again"]]
    at_prior: NotRequired[ReadOnly[Annotated[Sequence[str], "parameters that the data hardly determine"]]]


class Autopilot(TypedDict, total=False):
    """IMU of an autopilot, and its parameters."""

    firmware: Annotated[str, "ArduPilot or PX4"]
    imu: Annotated[int, "number of the IMU, from 1"]
    message: Annotated[str, "MAVLink message of the samples"]
    params_old: Annotated[Parameters, "parameters during the measurement, by name"]
    params_first: Annotated[Parameters, "those that were changed meanwhile, as they were at first"]
    params_new: Annotated[Parameters, "parameters to write, by name"]
    residual_mps2: Annotated[Number, "greatest error of |a| that the new parameters leave, m/s^2"]
    residual_old_mps2: Annotated[Number, "greatest error of |a| with the old parameters, m/s^2"]
    residual_deg: Annotated[Number, "greatest error of the direction that the new parameters leave, deg"]
    uncertainty_mps2: Annotated[Number, "standard uncertainty of |a|, m/s^2"]
    turn_deg: Annotated[Vector3, "rotation that the parameters cannot hold, deg"]
    mounting: Annotated[Matrix, "rotation of the board in the vehicle"]
    why: Annotated[str, "why there are no new parameters"]


class Write(TypedDict, total=False):
    """A write to a device."""

    to: Annotated[str, "the sink"]
    where: Annotated[str, "the device"]
    what: Annotated[str, "what was written, and how it was checked"]
    at: Annotated[str, "time, ISO 8601"]


class Merged(TypedDict, total=False):
    """Calibration that was merged with others."""

    created: Annotated[str, "time, ISO 8601"]
    temperature_c: Number
    b_a: Annotated[Vector3, "m/s^2"]
    recording_digest: str | None


class Earlier(TypedDict, total=False):
    """Biases of an earlier calibration that a check updated."""

    created: Annotated[str, "time, ISO 8601"]
    temperature_c: Number
    b_a: Annotated[Vector3, "m/s^2"]
    b_a_std: Annotated[Vector3, "m/s^2"]
    b_omega: Annotated[Vector3, "rad/s"]
    found: Annotated[str, "verdict of the check"]
    what: Annotated[str, "the change that the check found"]


class SensorNoise(TypedDict, total=False):
    """Noise of one sensor, rms over its three axes, in its unit (m/s^2 or rad/s)."""

    white_noise: Annotated[float, "noise density, units/sqrt(Hz), two-sided"]
    bias_instability: Annotated[float, "units"]
    random_walk: Annotated[float, "units/sqrt(s)"]
    at_most: Annotated[Sequence[str], "those that are upper ends of 95 % intervals"]


class NoiseFound(TypedDict, total=False):
    """Noise in a long rest, by `mpucal noise`."""

    created: Annotated[str, "time, ISO 8601"]
    seconds: Annotated[float, "length of the rest, s"]
    rate_hz: float
    accelerometer: Annotated[SensorNoise, "in m/s^2"]
    gyroscope: Annotated[SensorNoise, "in rad/s"]


class Extra(TypedDict, total=False):
    """Keys that are kept as they are, in Calibration.extra."""

    name: Annotated[str, "name of the board (`--name`)"]
    autopilot: Annotated[Autopilot, "of an IMU of a vehicle"]
    others: Annotated[Sequence[Mapping[str, Any]], "further IMUs of the vehicle, each with the keys of this table"]
    written: Annotated[Sequence[Write], "writes to devices"]
    merged: Annotated[Sequence[Merged], "the calibrations that were merged"]
    updated_from: Annotated[Sequence[Earlier], "biases before each update by a check, the oldest first"]
    noise: Annotated[NoiseFound, "noise in a long rest, by `mpucal noise`"]


class Core(TypedDict, total=False):
    """Keys with fields of their own in a Calibration."""

    format: Required[Annotated[str, {"const": FORMAT}]]
    version: Required[Annotated[int, {"const": VERSION}]]
    created: Annotated[str, "time, ISO 8601"]
    accelerometer: Required[Accelerometer]
    gyroscope: Gyroscope
    fit: Annotated[Fit, "the model, and the course of the estimation"]
    quality: Annotated[Quality, "the verdict, its reasons, and the uncertainty"]
    sensor: Annotated[Sensor, "the sensor that was calibrated"]
    applied_in_hardware: Hardware
    correlation: Annotated[Sequence[Number], (210,), "of the errors of 21 numbers, see above"]
    digest: Annotated[str, "of the document, see above"]


class Document(Core, Extra):
    """Content of calibration.json."""


def unwrap(hint: Any) -> Any:
    """Return a type without Required and NotRequired."""
    return unwrap(get_args(hint)[0]) if get_origin(hint) in (Required, NotRequired) else hint


class ArrayKey(NamedTuple):
    """Key of an array: its object in the document, its name there, the attribute of a Calibration, and the shape."""

    part: str
    key: str
    attribute: str
    shape: tuple[int, ...]


def _array_keys(part: str, kind: type, **attributes: str) -> list[ArrayKey]:
    """Return the keys of an object's arrays; `attributes` are those that have other names than their keys."""
    hints = get_type_hints(kind, include_extras=True)
    shapes = {key: unwrap(hint).__metadata__[0] for key, hint in hints.items()}
    return [
        ArrayKey(part, key, attributes.get(key, key), shape)
        for key, shape in shapes.items()
        if isinstance(shape, tuple)
    ]


ARRAYS = (
    *_array_keys("accelerometer", Accelerometer),
    *_array_keys("gyroscope", Gyroscope, noise_std="gyro_noise_std"),
    *_array_keys("applied_in_hardware", Hardware, b_a="applied_in_hardware"),
)
