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
from ..arguments import a_path, content, shaped, vectors
from ..data import GYRO_COUNTS, Recording, Sensor, Vector
from ..disk.whole import write_atomically
from ..errors import RecordingError, WrongType, WrongValue
from ..strict_json import MOST_BYTES, parsed
from .blob import NO_RANGE, Blob, BlobError
from .correlation import UNCORRELATED
from .digest import DIGEST, digest, doubt
from .document import arguments, checked, tellable, written
from .error_model import bias_mg, scale_factor_error
from .frozen import FrozenDict
from .keys import Fit, Quality, Verdict

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHAPES = {
    **dict.fromkeys(("D", "D_std", "K", "K_std"), (3, 3)),
    **dict.fromkeys(("b_a", "b_a_std", "noise_std", "b_omega", "b_omega_std", "gyro_noise_std"), (3,)),
    **dict.fromkeys(("applied_in_hardware", "b_a_slope", "b_a_slope_std"), (3,)),
    "temperature_range_c": (2,),
    "correlation": (21, 21),
}
F = TypeVar("F", bound=frames.Frame)
GOOD: Verdict = "good"
USABLE: Verdict = "usable"
REFUSED: Verdict = "refused"


def unknown(*shape: int) -> Vector:
    """NaN of a shape: a number that nobody knows."""
    return np.full(shape, np.nan)


@dataclass(frozen=True, eq=False, repr=False)
class Calibration:  # noqa: PLW1641 - arrays have no hash either
    """An accelerometer's D and b_a (the paper's equation 3), how sure they are, and what they rest on.

    Attributes
    ----------
    D : (3, 3), b_a : (3,) m/s^2: y = D s + b_a; D_std, b_a_std : their standard deviations.
    noise_std : (3,) m/s^2, the accelerometer's noise a sample.
    K : (3, 3), b_omega : (3,) rad/s: w = K (y - b_omega); K_std, b_omega_std, gyro_noise_std : likewise.
    fit, quality : mappings with the keys of calibration.json, see result/keys.py.
    sensor : what was calibrated.
    created : ISO 8601 time.
    applied_in_hardware : (3,) m/s^2 that offset registers subtract already; a consumer uses b_a minus this.
    b_a_slope : (3,) m/s^2 a degree Celsius, of which b_a grows away from sensor.temperature_c; zeros: not known to.
    b_a_slope_std : (3,). temperature_range_c : (2,) degrees Celsius, within which that was seen.
    extra : further top-level keys of the document (name, autopilot, others, written, merged).
    correlation : (21, 21) of the errors of D row-major, b_a, K's upper triangle and b_omega, in this order; the
        identity where it is not known.
    doubt : why the numbers of the file that it was read from may not be those that were saved; empty where they are.

    Unknown numbers are NaN (null in the file). Calibrations are equal whose calibration.json is the same; they have no
    hash, as their arrays have none.
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
            object.__setattr__(self, name, shaped(getattr(self, name), name, shape))
        for name in ("fit", "quality", "extra"):
            object.__setattr__(self, name, FrozenDict(getattr(self, name)))

    def __eq__(self, other: object) -> bool:
        return self.document() == other.document() if isinstance(other, Calibration) else NotImplemented

    def __repr__(self) -> str:
        gain, bias = scale_factor_error(self.D), bias_mg(self.b_a)
        numbers = [" ".join(f"{value:+.4g}" for value in values) for values in (gain, bias)]
        said = f"scale factor error {numbers[0]} %, bias {numbers[1]} mg"
        return f"<Calibration of {self.sensor.chip or 'an accelerometer'}: {self.verdict}; {said}>"

    def _repr_html_(self) -> str:
        return str(resolve_name("mpucal.report.notebook:html")(self))

    def plot(self, recording: Recording | str | PathLike[str] | None = None) -> Figure:
        """A figure of the parameters beside the data sheet; of a recording |a| before and after. Needs mpucal[plot].

        Raises
        ------
        ImportError : matplotlib is not installed. WrongType : no recording, nor the path of one.
        """
        seen = None if recording is None else resolve_name("mpucal.api:recording_of")(recording)
        figure: Figure = resolve_name("mpucal.report.notebook:plot_calibration")(self, seen)
        return figure

    @property
    def follows_temperature(self) -> bool:
        """Whether b_a(T) is known, and not b_a alone."""
        return bool(np.any(self.b_a_slope))

    def b_a_at(self, temperature_c: ArrayLike | None = None) -> Vector:
        """b_a(T) (..., 3) m/s^2 at (...) degrees Celsius; b_a where that is NaN, None, or b_a(T) is not known.

        Beyond the range in which it was seen, b_a(T) stays as at its end.
        """
        if temperature_c is None or not self.follows_temperature:
            return self.b_a
        T_0 = self.sensor.temperature_c
        T = np.clip(np.asarray(temperature_c, float), *self.temperature_range_c)
        away = np.nan_to_num(T - (np.nan if T_0 is None else T_0))
        return np.asarray(self.b_a + away[..., None] * self.b_a_slope)

    @property
    def inverse(self) -> Vector:
        """inv(D) (3, 3)."""
        return np.asarray(np.linalg.inv(self.D))

    @property
    def b_a_to_subtract(self) -> Vector:
        """(3,) m/s^2, b_a without what the chip's offset registers subtract already."""
        return np.asarray(self.b_a - self.applied_in_hardware)

    @property
    def verdict(self) -> Verdict:
        """good, usable or refused; refused where nobody judged."""
        return self.quality.get("verdict", REFUSED)

    @property
    def magnitude_std(self) -> float:
        """Standard uncertainty of the calibrated |a| [m/s^2], rms over all directions; 0 where it is unknown."""
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
        """Calibrated measurements (the paper's equation 4).

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
        WrongType, WrongValue : what is given is no such array.
        """
        if frames.is_frame(acc):
            return self._applied_to_frame(acc)
        y = vectors(acc, "acc", "m/s^2")
        T = None if temperature_c is None else shaped(temperature_c, "temperature_c", y.shape[:-1], ())
        omega = None if gyr is None else shaped(vectors(gyr, "gyr", "rad/s"), "gyr", y.shape)
        # b_a minus what the offset registers subtract: y comes from the chip with that already gone
        y = y - (self.b_a_at(T) - self.applied_in_hardware)
        a: Vector = y @ self.inverse.T
        return a if omega is None else (a, self._rates(omega))

    def _applied_to_frame(self, frame: Any) -> Any:
        T = np.asarray(frame["temperature_c"], float) if "temperature_c" in frame.columns else None
        new: dict[tuple[str, ...], Vector] = {
            frames.ACC: self.apply(frames.columns(frame, frames.ACC), temperature_c=T)
        }
        if frames.places(frame, frames.GYR):
            new[frames.GYR] = self._rates(vectors(frames.columns(frame, frames.GYR), "gyr", "rad/s"))
        return frames.replaced(frame, new)

    def _rates(self, omega: Vector) -> Vector:
        return np.asarray((omega - np.nan_to_num(self.b_omega)) @ self.K.T)

    def tellable(self) -> Calibration:
        """The same, in which unknown is what no reader takes: of a fit that failed."""
        arrays: dict[str, Any] = tellable(vars(self))
        return replace(self, **arrays)

    def document(self) -> dict[str, Any]:
        """The content of calibration.json; NaN becomes None."""
        return written(vars(self), self.follows_temperature)

    def json(self) -> str:
        """The document as text, with its digest; without one where its numbers are in doubt."""
        document = self.document()
        signed = document if self.doubt else {**document, DIGEST: digest(document)}
        return json.dumps(signed, indent=2, allow_nan=False) + "\n"

    def blob(self) -> Blob:
        """The config blob of this calibration, see firmware_protocol.md."""
        sensor = self.sensor
        return Blob(
            who_am_i=sensor.who_am_i or 0,
            accel_range_g=sensor.accel_range_g or 0.0,
            gyro_range_dps=sensor.gyro_range_dps or 0.0,
            D=tuple(self.D.ravel().tolist()),
            b_a=tuple(self.b_a.tolist()),
            gravity=float(self.fit.get("gravity") or math.nan),
            temperature_c=math.nan if sensor.temperature_c is None else sensor.temperature_c,
            created=self.created,
            applied_b_a=tuple(self.applied_in_hardware.tolist()),
            K=tuple(self.K.ravel().tolist()),
            b_omega=tuple(self.b_omega.tolist()),
            b_a_slope=tuple(self.b_a_slope.tolist()),
            temperature_range_c=tuple(self.temperature_range_c.tolist()) if self.follows_temperature else NO_RANGE,
            gyro_counts=GYRO_COUNTS,
        )

    def save(self, path: str | Path) -> None:
        """Write calibration.json (`.json`) or the config blob (`.bin`), atomically.

        Raises
        ------
        OutputError : the file cannot be written.
        WrongValue : another ending. ValueError : a blob of a calibration that holds unknown numbers.
        """
        path = a_path(path, "the file of a calibration")
        if path.suffix == ".json":
            write_atomically(path, self.json().encode())
        elif path.suffix == ".bin":
            write_atomically(path, self.blob().encode())
        else:
            raise WrongValue(f"a calibration is not saved as {path.name}", "end its name with .json or .bin")

    @classmethod
    def load(cls, path: str | Path) -> Calibration:
        """Read a calibration.json or a config blob.

        Raises
        ------
        RecordingError : no such file, or no calibration in it.
        """
        path = a_path(path, "a calibration")
        data = content(path, MOST_BYTES)
        if path.suffix == ".bin":
            try:
                return cls.from_blob(Blob.decode(data))
            except BlobError as error:
                raise RecordingError(f"{path} is no config blob: {error}", "give an undamaged blob") from error
        try:
            document = checked(parsed(data))
            return replace(cls(**arguments(document)), doubt=doubt(document))
        except ValueError as error:
            raise RecordingError(f"{path} holds no calibration ({error})", "give a calibration.json") from error

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Calibration:
        """The inverse of `document`; unknown keys are ignored, missing ones are unknown numbers.

        Raises
        ------
        WrongType : it is no mapping. WrongValue : it is no document of a calibration.
        """
        remedy = "give what Calibration.document() returned, or load a calibration.json"
        if not isinstance(document, Mapping):
            raise WrongType(f"the document of a calibration is given as {type(document).__name__}", remedy)
        try:
            return cls(**arguments(document))
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise WrongValue(f"this is no document of a calibration ({error})", remedy) from error

    @classmethod
    def from_blob(cls, blob: Blob) -> Calibration:
        """A calibration of a blob's numbers; what a blob does not hold is unknown.

        Raises
        ------
        WrongType : it is no blob.
        """
        if not isinstance(blob, Blob):
            raise WrongType(f"a blob is given as {type(blob).__name__}", "give what Calibration.blob() returned")
        # of a unit of GYRO_COUNTS one of the blob's
        unit = GYRO_COUNTS / (blob.gyro_counts or GYRO_COUNTS)
        return cls(
            D=np.array(blob.D).reshape(3, 3),
            b_a=np.array(blob.b_a),
            K=np.array(blob.K).reshape(3, 3) * unit,
            b_omega=np.array(blob.b_omega) / unit,
            fit=cast(Fit, {"gravity": blob.gravity}),
            sensor=Sensor(
                who_am_i=blob.who_am_i or None,
                accel_range_g=blob.accel_range_g or None,
                gyro_range_dps=blob.gyro_range_dps or None,
                temperature_c=None if math.isnan(blob.temperature_c) else blob.temperature_c,
            ),
            created=blob.created,
            applied_in_hardware=np.array(blob.applied_b_a),
            b_a_slope=np.array(blob.b_a_slope),
            temperature_range_c=np.array(blob.temperature_range_c),
        )
