"""The result of a calibration: its numbers, how they are applied, and its two files."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, TypeVar, cast, overload

import numpy as np
from numpy.typing import ArrayLike

from .. import frames
from ..arguments import check_path, check_shape, check_vectors, read_limited
from ..data import GYRO_COUNTS, STANDARD_GRAVITY_MPS2, Recording, Sensor, Vector
from ..disk.atomic import write_atomically
from ..errors import RecordingError, WrongType, WrongValue
from ..strict_json import MOST_BYTES, parse_json
from .blob import MAGIC, Blob, BlobError, is_invertible
from .correlation import UNCORRELATED
from .document import DIGEST, digest, digest_warning, drop_unserialisable, from_document, to_document
from .error_model import bias_mg, scale_factor_error
from .keys import ARRAYS, Fit, FrozenDict, Quality, Verdict

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# field of a config blob -> attribute
OF_BLOB = {"applied_b_a": "applied_in_hardware"} | {
    name: name for name in ("D", "b_a", "K", "b_omega", "b_a_slope", "temperature_range_c")
}
SHAPES = {row.attribute: row.shape for row in ARRAYS} | {"correlation": UNCORRELATED.shape}
F = TypeVar("F", bound=frames.Frame)
GOOD: Verdict = "good"
USABLE: Verdict = "usable"
REFUSED: Verdict = "refused"


def unknown(*shape: int) -> Vector:
    """Return NaN of a shape, for numbers that are not known."""
    return np.full(shape, np.nan)


@dataclass(frozen=True, eq=False, repr=False)
class Calibration:  # noqa: PLW1641 - arrays have no hash either
    """Result of a calibration: D and b_a (the paper's equation 3), their uncertainties, the fit and its quality.

    Attributes
    ----------
    D : (3, 3), b_a : (3,) m/s^2: y = D s + b_a; D_std, b_a_std : their standard deviations.
    noise_std : (3,) m/s^2, the accelerometer's noise of one sample.
    K : (3, 3), b_omega : (3,) rad/s: w = K (y - b_omega); K_std, b_omega_std, gyro_noise_std : as of D and b_a.
    fit, quality : mappings with the keys of calibration.json, see result/keys.py.
    sensor : the sensor that was calibrated.
    created : ISO 8601 time.
    applied_in_hardware : (3,) m/s^2 that offset registers subtract already; a consumer uses b_a minus this.
    b_a_slope : (3,) m/s^2 per degree Celsius, the slope of b_a(T) from sensor.temperature_c on; zeros: not known.
    b_a_slope_std : (3,). temperature_range_c : (2,) degrees Celsius, the range in which b_a(T) was measured.
    extra : further top-level keys of the document (name, autopilot, others, written, merged).
    correlation : (21, 21) of the errors of D row-major, b_a, K's upper triangle and b_omega, in this order; the
        identity if it is not known.
    doubt : why the numbers may not be those that were saved, by the file's digest; empty if they are.

    Unknown numbers are NaN (null in the file). Calibrations with the same calibration.json are equal, and have no hash.
    """

    D: Vector
    b_a: Vector
    D_std: Vector = field(default_factory=lambda: unknown(3, 3))
    b_a_std: Vector = field(default_factory=lambda: unknown(3))
    noise_std: Vector = field(default_factory=lambda: unknown(3))
    K: Vector = field(default_factory=lambda: np.eye(3))
    b_omega: Vector = field(default_factory=lambda: unknown(3))
    K_std: Vector = field(default_factory=lambda: unknown(3, 3))
    b_omega_std: Vector = field(default_factory=lambda: unknown(3))
    gyro_noise_std: Vector = field(default_factory=lambda: unknown(3))
    fit: Fit = field(default_factory=cast("type[Fit]", FrozenDict))
    quality: Quality = field(default_factory=cast("type[Quality]", FrozenDict))
    sensor: Sensor = field(default_factory=Sensor)
    created: str = ""
    applied_in_hardware: Vector = field(default_factory=lambda: np.zeros(3))
    extra: Mapping[str, Any] = field(default_factory=FrozenDict)
    b_a_slope: Vector = field(default_factory=lambda: np.zeros(3))
    b_a_slope_std: Vector = field(default_factory=lambda: unknown(3))
    temperature_range_c: Vector = field(default_factory=lambda: unknown(2))
    correlation: Vector = field(default_factory=UNCORRELATED.copy)
    doubt: str = ""

    def __post_init__(self) -> None:
        for name, shape in SHAPES.items():
            object.__setattr__(self, name, check_shape(getattr(self, name), name, shape))
        for name in ("fit", "quality", "extra"):
            object.__setattr__(self, name, FrozenDict(getattr(self, name)))

    def __eq__(self, other: object) -> bool:
        return self.document() == other.document() if isinstance(other, Calibration) else NotImplemented

    def __repr__(self) -> str:
        gain, bias = scale_factor_error(self.D), bias_mg(self.b_a)
        numbers = [" ".join(f"{value:+.4g}" for value in values) for values in (gain, bias)]
        errors = f"scale factor error {numbers[0]} %, bias {numbers[1]} mg"
        return f"<Calibration of {self.sensor.chip or 'an accelerometer'}: {self.verdict}; {errors}>"

    def _repr_html_(self) -> str:
        return str(resolve_name("mpucal.report.notebook:html")(self))

    def plot(self, recording: Recording | str | PathLike[str] | None = None) -> Figure:
        """Plot the parameters beside the data sheet, and |a| of a recording before and after; needs mpucal[plot].

        Raises
        ------
        ImportError : matplotlib is not installed. WrongType : neither a recording nor its path.
        """
        seen = None if recording is None else resolve_name("mpucal.api:recording_of")(recording)
        figure: Figure = resolve_name("mpucal.report.notebook:plot_calibration")(self, seen)
        return figure

    @property
    def follows_temperature(self) -> bool:
        """Return True if b_a(T) is known."""
        return bool(np.any(self.b_a_slope))

    def b_a_at(self, temperature_c: ArrayLike | None = None) -> Vector:
        """Return b_a(T) (..., 3) m/s^2 at (...) degrees Celsius; b_a if that is NaN or None, or b_a(T) is not known.

        Beyond temperature_range_c, b_a(T) is constant.
        """
        if temperature_c is None or not self.follows_temperature:
            return self.b_a
        T_0 = self.sensor.temperature_c
        T = np.clip(np.asarray(temperature_c, float), *self.temperature_range_c)
        away = np.nan_to_num(T - (np.nan if T_0 is None else T_0))
        return np.asarray(self.b_a + away[..., None] * self.b_a_slope)

    @property
    def inverse(self) -> Vector:
        """Return inv(D) (3, 3)."""
        return np.asarray(np.linalg.inv(self.D))

    @property
    def b_a_to_subtract(self) -> Vector:
        """Return b_a (3,) m/s^2 without the part that the chip's offset registers subtract already."""
        return np.asarray(self.b_a - self.applied_in_hardware)

    @property
    def verdict(self) -> Verdict:
        """Return good, usable or refused; refused if the calibration was not judged."""
        return self.quality.get("verdict", REFUSED)

    @property
    def is_regular(self) -> bool:
        """Return True if D and b_a are known and D can be inverted."""
        return bool(np.isfinite(self.b_a).all()) and is_invertible(self.D.ravel().tolist())

    @property
    def objection(self) -> str:
        """Return why the calibration must not be used, as a clause; empty if it may be."""
        # a config blob has no verdict, and a refused calibration has no blob
        if self.quality.get("verdict") == REFUSED:
            return "the calibration was refused"
        return "" if self.is_regular else "the calibration lacks D or b_a, or D has no inverse"

    @property
    def gravity(self) -> float:
        """Return the local gravity [m/s^2], to which the scale factors refer; standard gravity if it is not known."""
        return float(self.fit.get("gravity") or STANDARD_GRAVITY_MPS2)

    @property
    def magnitude_std(self) -> float:
        """Return the standard uncertainty of the calibrated |a| [m/s^2], rms over all directions; 0 if unknown."""
        std = self.quality.get("error_std", {}).get("magnitude")
        return float(std) if std is not None and math.isfinite(std) else 0.0

    @overload
    def apply(self, acc: F) -> F: ...
    @overload
    def apply(self, acc: ArrayLike, gyr: None = None, temperature_c: ArrayLike | None = None) -> Vector: ...
    @overload
    def apply(
        self, acc: ArrayLike, gyr: ArrayLike, temperature_c: ArrayLike | None = None
    ) -> tuple[Vector, Vector]: ...
    def apply(self, acc: Any, gyr: ArrayLike | None = None, temperature_c: ArrayLike | None = None) -> Any:
        """Return calibrated measurements (the paper's equation 4).

        Parameters
        ----------
        acc : (..., 3) m/s^2 as measured, or a data frame of pandas or polars with the columns of
            Recording.from_dataframe, of which the rates may be missing. gyr : (..., 3) rad/s as measured, or None.
        temperature_c : (...) degrees Celsius of the chip, for b_a(T); None: b_a.

        Returns
        -------
        (..., 3) m/s^2, inv(D) (y - b_a); with gyr the pair of it and K (y - b_omega), (..., 3) rad/s; of a data frame
        one with the same index and columns.

        Raises
        ------
        WrongType, WrongValue : an argument is not such an array.
        """
        if frames.is_frame(acc):
            return self._applied_to_frame(acc)
        y = check_vectors(acc, "acc", "m/s^2")
        T = None if temperature_c is None else check_shape(temperature_c, "temperature_c", y.shape[:-1], ())
        omega = None if gyr is None else check_shape(check_vectors(gyr, "gyr", "rad/s"), "gyr", y.shape)
        # the offset registers have subtracted their part from y already
        y = y - (self.b_a_at(T) - self.applied_in_hardware)
        a: Vector = y @ self.inverse.T
        return a if omega is None else (a, self._rates(omega))

    def _applied_to_frame(self, frame: Any) -> Any:
        T = np.asarray(frame["temperature_c"], float) if "temperature_c" in frame.columns else None
        new: dict[tuple[str, ...], Vector] = {
            frames.ACC: self.apply(frames.columns(frame, frames.ACC), temperature_c=T)
        }
        if frames.column_names(frame, frames.GYR):
            new[frames.GYR] = self._rates(check_vectors(frames.columns(frame, frames.GYR), "gyr", "rad/s"))
        return frames.replace_columns(frame, new)

    def _rates(self, omega: Vector) -> Vector:
        return np.asarray((omega - np.nan_to_num(self.b_omega)) @ self.K.T)

    def drop_unserialisable(self) -> Calibration:
        """Return a copy with NaN for numbers of a failed fit that a reader of calibration.json would refuse."""
        arrays: dict[str, Any] = drop_unserialisable(vars(self))
        return replace(self, **arrays)

    def document(self) -> dict[str, Any]:
        """Return the content of calibration.json; NaN becomes None."""
        return to_document(vars(self), self.follows_temperature)

    def json(self) -> str:
        """Return the document as text, with its digest unless its numbers are in doubt."""
        document = self.document()
        signed = document if self.doubt else {**document, DIGEST: digest(document)}
        return json.dumps(signed, indent=2, allow_nan=False) + "\n"

    def blob(self) -> Blob:
        """Return the config blob of this calibration; see firmware_protocol.md."""
        sensor = self.sensor
        arrays = {name: tuple(getattr(self, attribute).ravel().tolist()) for name, attribute in OF_BLOB.items()}
        if not self.follows_temperature:
            arrays["temperature_range_c"] = Blob.temperature_range_c
        return Blob(
            **arrays,
            who_am_i=sensor.who_am_i or 0,
            accel_range_g=sensor.accel_range_g or 0.0,
            gyro_range_dps=sensor.gyro_range_dps or 0.0,
            gravity=float(self.fit.get("gravity") or math.nan),
            temperature_c=math.nan if sensor.temperature_c is None else sensor.temperature_c,
            created=self.created,
            gyro_counts=GYRO_COUNTS,
        )

    def save(self, path: str | Path) -> None:
        """Write calibration.json (`.json`) or the config blob (`.bin`), atomically.

        Raises
        ------
        OutputError : the file cannot be written.
        WrongValue : another suffix. ValueError : a blob of a calibration with unknown numbers.
        """
        path = check_path(path, "the file of a calibration")
        if path.suffix.lower() == ".json":
            write_atomically(path, self.json().encode())
        elif path.suffix.lower() == ".bin":
            write_atomically(path, self.blob().encode())
        else:
            raise WrongValue(f"a calibration cannot be saved as {path.name}", "end its name with .json or .bin")

    @classmethod
    def load(cls, path: str | Path) -> Calibration:
        """Read a calibration.json or a config blob.

        Raises
        ------
        RecordingError : there is no such file, or no calibration in it.
        """
        path = check_path(path, "a calibration")
        data = read_limited(path, MOST_BYTES)
        if path.suffix.lower() == ".bin" or data.startswith(MAGIC):
            try:
                return cls.from_blob(Blob.decode(data))
            except BlobError as error:
                raise RecordingError(f"{path} is not a config blob: {error}", "give an undamaged blob") from error
        try:
            document = parse_json(data)
            return replace(cls(**from_document(document)), doubt=digest_warning(document))
        except ValueError as error:
            raise RecordingError(f"{path} holds no calibration ({error})", "give a calibration.json") from error

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Calibration:
        """Return the calibration of a document; unknown keys are ignored, missing ones are unknown numbers.

        Raises
        ------
        WrongType : it is not a mapping. WrongValue : it is not a document of a calibration.
        """
        remedy = "give what Calibration.document() returned, or load a calibration.json"
        if not isinstance(document, Mapping):
            raise WrongType(f"the document of a calibration is given as {type(document).__name__}", remedy)
        try:
            return cls(**from_document(document))
        except ValueError as error:
            raise WrongValue(f"this is not a document of a calibration ({error})", remedy) from error

    @classmethod
    def from_blob(cls, blob: Blob) -> Calibration:
        """Return the calibration in a blob; other numbers are unknown.

        Raises
        ------
        WrongType : it is not a blob.
        """
        if not isinstance(blob, Blob):
            raise WrongType(f"a blob is given as {type(blob).__name__}", "give what Calibration.blob() returned")
        # K and b_omega of the blob refer to its own counts of full scale
        unit = GYRO_COUNTS / (blob.gyro_counts or GYRO_COUNTS)
        arrays: dict[str, Any] = {key: np.reshape(getattr(blob, name), SHAPES[key]) for name, key in OF_BLOB.items()}
        arrays |= {"K": arrays["K"] * unit, "b_omega": arrays["b_omega"] / unit}
        return cls(
            **arrays,
            fit=cast(Fit, {"gravity": blob.gravity}),
            sensor=Sensor(
                who_am_i=blob.who_am_i or None,
                accel_range_g=blob.accel_range_g or None,
                gyro_range_dps=blob.gyro_range_dps or None,
                temperature_c=None if math.isnan(blob.temperature_c) else blob.temperature_c,
            ),
            created=blob.created,
        )
