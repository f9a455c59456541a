"""Samples and recordings, with what is known of their sensor: arrays in s, m/s^2, rad/s and degrees Celsius."""

from __future__ import annotations

import math
import re
import reprlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from operator import attrgetter, itemgetter
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from . import frames
from .arguments import (
    LARGEST,
    check_column,
    check_flat,
    check_increasing,
    check_mask,
    check_rows,
    is_plausible,
    to_seconds,
)
from .arguments import Mask as Mask  # noqa: PLC0414 - rooms above take them from here
from .arguments import Vector as Vector  # noqa: PLC0414
from .arguments import Whole as Whole  # noqa: PLC0414
from .clocks.sample_clock import GAP_INTERVALS as GAP_INTERVALS  # noqa: PLC0414
from .clocks.stamps import FEWEST, Clock, fit_clock
from .errors import WrongType, escape_line
from .origin import Origin

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STANDARD_GRAVITY_MPS2 = 9.80665
AXES = "xyz"

# Counts at full scale, with which mpucal, its exports and its firmware convert to SI units. PS-MPU-6000A r3.4, 6.1 and
# 6.2, and PS-MPU-9250A r1.0, 3.1 and 3.2, "Sensitivity Scale Factor": 16384 LSB/g at +-2 g and 131 LSB/(deg/s) at +-250
# deg/s, each half of it at the next range (32.75 and 16.375 are printed as 32.8 and 16.4).
ACCEL_COUNTS = 32768.0
GYRO_COUNTS = 32750.0
# ppm of a clock's rate beyond a quartz crystal's, which is within 100 ppm; as a scale factor error it is a tenth of the
# accuracy wanted
MOST_CLOCK_PPM = 500.0
# full-scale ranges of sensors in recordings, [g] and [deg/s]; those of a chip are in its registers
ACCEL_RANGES_G, GYRO_RANGES_DPS = (2, 4, 8, 16), (125, 250, 500, 1000, 2000, 4000)
# samples that are treated at once: 1 MB fits a cache; for larger products BLAS starts threads, which takes longer
RUN = 1 << 14
# names are exported to scripts and source code: these characters cannot end a string or comment there
NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_ .:+()-]{0,63}")
MAY_BE_NEGATIVE = ("temperature_c", "clock_ppm", "accel_lag_s")


def mps2_per_count(range_g: float) -> float:
    """Return the acceleration [m/s^2] of one count at a full scale [g]."""
    return range_g * STANDARD_GRAVITY_MPS2 / ACCEL_COUNTS


def rad_s_per_count(range_dps: float) -> float:
    """Return the rate [rad/s] of one count at a full scale [deg/s]."""
    return math.radians(range_dps / GYRO_COUNTS)


@dataclass(frozen=True)
class Sensor:
    """Properties of the sensor of a recording; None if unknown. The meanings are also those of calibration.json."""

    chip: Annotated[str | None, "name"] = None
    who_am_i: Annotated[int | None, "WHO_AM_I"] = None
    accel_range_g: float | None = None
    gyro_range_dps: float | None = None
    rate_hz: float | None = None
    temperature_c: float | None = None
    accel_offsets: Annotated[tuple[int, int, int] | None, "words of the offset registers x, y, z meanwhile"] = None
    message: Annotated[str | None, "MAVLink message of the samples, for an IMU of a vehicle"] = None
    least_noise: Annotated[tuple[float, float], "least noise of a sample, m/s^2 and rad/s (1 sigma)"] = (0.0, 0.0)
    steps: Annotated[tuple[float, float], "resolution, if coarser than the noise, m/s^2 and rad/s"] = (0.0, 0.0)
    clock_ppm: Annotated[float | None, "rate error of the bus's own clock, which was corrected"] = None
    clock_std: Annotated[float | None, "remaining relative standard deviation of the scale of times"] = None
    accel_lag_s: Annotated[float, "delay of the accelerometer after the gyroscope by the filters"] = 0.0
    time_std: Annotated[float, "standard deviation of a sample's time, in common for tenths of a second, s"] = 0.0

    @property
    def origin(self) -> Origin:
        """Origin of its samples; an MPU is a chip behind a kernel driver, too."""
        if self.message is not None:
            return Origin.VEHICLE
        if self.who_am_i is not None:
            return Origin.CHIP
        return Origin.FILE if self.chip is None else Origin.DEVICE

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Self:
        """Return the sensor of a document with values of JSON types; other keys are ignored.

        Raises
        ------
        ValueError : a value is not a name or a finite number as required.
        """
        known = {f.name for f in fields(cls)}
        return cls(**{key: _parse_field(key, value) for key, value in document.items() if key in known})


def _parse_field(key: str, value: Any) -> Any:
    """Return a value of a Sensor's document as the Sensor holds it."""
    if value is None:
        return None
    if key in ("chip", "message"):
        valid = isinstance(value, str) and NAME.fullmatch(value) is not None
    elif key in ("accel_offsets", "least_noise", "steps"):
        kind, count = (int, 3) if key == "accel_offsets" else (int | float, 2)
        valid = isinstance(value, list | tuple) and len(value) == count and all(_is(kind, item) for item in value)
        value = tuple(value) if valid else value
    elif key == "who_am_i":
        valid = _is(int, value) and 0 <= value <= 0xFF
    else:
        valid = _is(int | float, value) and (value >= 0 or key in MAY_BE_NEGATIVE)
    if not valid:
        raise ValueError(f"sensor: {key} is {reprlib.repr(value)}")
    return value


def _is(kind: Any, value: Any) -> bool:
    return isinstance(value, kind) and not isinstance(value, bool) and abs(value) <= LARGEST


@dataclass(frozen=True)
class Autopilot:
    """Autopilot that sends the stream of an IMU, corrected by its parameters.

    Attributes
    ----------
    firmware : ArduPilot or PX4. imu : number of the IMU, from 1. message : MAVLink name of the stream.
    parameters : all known ones, by name. first : those that were changed during the recording, as they were at first.
    """

    firmware: str
    imu: int
    message: str
    parameters: Mapping[str, float]
    first: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Samples:  # noqa: PLW1641 - arrays have no hash either
    """Run of samples, one row per instant; two are equal if all values are, including unknown ones.

    Attributes
    ----------
    t : (n,) s, increasing.
    acc : (n, 3) m/s^2 at the chip's nominal scale, the paper's y_t.
    gyr : (n, 3) rad/s at the chip's nominal scale, the paper's omega-bar_t.
    temperature_c : (n,) degrees Celsius, NaN where unknown.
    gap : (n,) True where samples just before are missing.
    acc_clipped, gyr_clipped : (n,) True where an axis was at the end of its range.
    """

    t: Vector
    acc: Vector
    gyr: Vector
    temperature_c: Vector
    gap: Mask
    acc_clipped: Mask
    gyr_clipped: Mask

    def __len__(self) -> int:
        return len(self.t)

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(_same(getattr(self, f.name), getattr(other, f.name)) for f in fields(self))

    @classmethod
    def joined(cls, parts: list[Samples]) -> Samples:
        """Return all parts in succession; a single part shares its arrays, and no parts give no samples."""
        if not parts:
            return Samples.empty()
        if len(parts) == 1:
            return Samples(*_arrays(parts[0]))
        return Samples(*map(np.concatenate, zip(*map(_arrays, parts), strict=True)))

    def each(self, function: Callable[[Any], Any]) -> Samples:
        """Return the samples whose arrays are `function` of these arrays, such as a part of each."""
        return Samples(*map(function, _arrays(self)))

    def at(self, places: Any) -> Samples:
        """Return the samples at some places: a slice, a mask (n,), or numbers of samples."""
        return self.each(itemgetter(places))

    @classmethod
    def empty(cls) -> Samples:
        """Return an empty run of samples."""
        none, three, no = np.zeros(0), np.zeros((0, 3)), np.zeros(0, bool)
        return Samples(none, three, three.copy(), none.copy(), no, no.copy(), no.copy())


# an attrgetter, as a session calls it thousands of times
_arrays = attrgetter(*(f.name for f in fields(Samples)))


@dataclass(frozen=True, eq=False, repr=False)
class Recording(Samples):
    """Recording of one sensor: samples with metadata.

    Attributes
    ----------
    flat : (first, last + 1) samples known to lie flat and still; None: to be found.
    sensor : properties of the sensor.
    name : for messages.
    recovered : None, or a sentence on the part of a damaged file that was read.
    utc_ns : the time of day at t = 0, ns since 1970; None: unknown.
    autopilot : for an IMU of a vehicle, the autopilot that corrected the samples.
    others : further IMUs of that vehicle, turned with it.
    taken : None, or a sentence on how a file's columns and units were read.
    interrupted : times [s] at which the measurement was interrupted on purpose, or with mpucal's knowledge. In the gap
        that ends next after each, the board may have been turned, but nothing was lost.
    """

    flat: tuple[int, int] | None = None
    sensor: Sensor = Sensor()
    name: str = "recording"
    recovered: str | None = None
    utc_ns: int | None = None
    autopilot: Autopilot | None = None
    others: tuple[Recording, ...] = ()
    taken: str | None = None
    interrupted: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        # a file may be called anything
        object.__setattr__(self, "name", escape_line(self.name))

    @classmethod
    def from_arrays(
        cls,
        t: ArrayLike,
        acc: ArrayLike,
        gyr: ArrayLike,
        flat: tuple[int, int] | None = None,
        *,
        temperature_c: ArrayLike | None = None,
        gap: ArrayLike | None = None,
        acc_clipped: ArrayLike | None = None,
        gyr_clipped: ArrayLike | None = None,
        sensor: Sensor | None = None,
        name: str = "recording",
        taken: str | None = None,
    ) -> Recording:
        """Return a recording of plain arrays, after checks.

        Parameters
        ----------
        t : (n,) s, increasing, or datetime64, of which the first is 0 s. Stamps of arrival, late or one for a burst of
            samples, are replaced by the sensor's own clock, as in files; `taken` says so.
        acc : (n, 3) m/s^2. gyr : (n, 3) rad/s.
        flat : (first, last + 1) samples that lie flat, if known.
        temperature_c : (n,); its mean becomes the sensor's temperature if that is not set.
        gap, acc_clipped, gyr_clipped : (n,) bool, see Samples.

        Raises
        ------
        ArraysError : wrong shapes, values that are not numbers, or time that does not increase. It is a RecordingError
            and a ValueError. WrongType : `sensor` is not a Sensor.
        """
        if not isinstance(sensor, Sensor | None):
            raise WrongType(
                f"{name}: sensor is {sensor!r}", "give a Sensor, such as that of another recording, or leave it out"
            )
        t = to_seconds(t, name)
        n = len(t)
        acc, gyr = check_rows(acc, "acc", n, name), check_rows(gyr, "gyr", n, name)
        warm = np.full(n, np.nan) if temperature_c is None else check_column(temperature_c, "temperature_c", n, name)
        sensor, missing = sensor or Sensor(), check_mask(gap, "gap", n, name)
        clock = clock_of(t, sensor)
        known = warm[is_plausible(warm)]
        if sensor.temperature_c is None and len(known):
            sensor = replace(sensor, temperature_c=float(known.mean()))
        return cls(
            check_increasing(clock.t, name),
            acc,
            gyr,
            warm,
            missing | clock.gap,
            check_mask(acc_clipped, "acc_clipped", n, name),
            check_mask(gyr_clipped, "gyr_clipped", n, name),
            flat=None if flat is None else check_flat(flat, n, name),
            sensor=sensor,
            name=name,
            taken=" ".join(filter(None, (taken, clock.describe(name)))) or None,
        )

    @classmethod
    def from_dataframe(
        cls, frame: Any, flat: tuple[int, int] | None = None, *, sensor: Sensor | None = None, name: str = "recording"
    ) -> Recording:
        """Return a recording from columns t, ax, ay, az [m/s^2], gx, gy, gz [rad/s] of a frame of pandas or polars.

        The names may end with their units, as those of `to_dataframe` (t_s, ax_mps2, gx_rad_s). Without a column t, the
        index of pandas is the time. The columns temperature_c, gap, acc_clipped and gyr_clipped are read, too.

        Raises
        ------
        WrongType : it is not a data frame. WrongValue : a column is missing. ArraysError : see from_arrays.
        """
        given = frames.recording_arrays(frame)
        t, acc, gyr = given.pop("t"), given.pop("acc"), given.pop("gyr")
        return cls.from_arrays(t, acc, gyr, flat, **given, sensor=sensor, name=name)

    def to_dataframe(self, library: Literal["pandas", "polars"] = "pandas") -> Any:
        """Return a data frame with columns t_s, ax_mps2 ... gz_rad_s, temperature_c, gap, acc_clipped and gyr_clipped.

        Raises
        ------
        WrongValue : another library. ImportError : the library is not installed.
        """
        return frames.make_frame(library, {f.name: getattr(self, f.name) for f in fields(Samples)})

    def __repr__(self) -> str:
        seconds = float(self.t[-1] - self.t[0]) if len(self) else 0.0
        rate = f" at {self.rate_hz:.4g} Hz" if len(self) > 1 else ""
        return f"<Recording {self.name}: {len(self)} samples, {seconds:.1f} s{rate}>"

    def plot(self) -> Figure:
        """Plot accelerations and rates over time; needs mpucal[plot].

        Raises
        ------
        ImportError : matplotlib is not installed.
        """
        figure: Figure = resolve_name("mpucal.report.notebook:plot_recording")(self)
        return figure

    @cached_property
    def rate_hz(self) -> float:
        """Return the median sample rate [Hz]."""
        return float(1.0 / np.median(np.diff(self.t)))

    def part(self, first: int, last: int) -> Self:
        """Return samples first..last-1; `flat` is cut accordingly, or None if it lies outside."""
        flat = None
        if self.flat is not None:
            a, b = max(self.flat[0], first) - first, min(self.flat[1], last) - first
            flat = (a, b) if b > a else None
        return replace(self, flat=flat, **vars(self.at(slice(first, last))))

    def without(self, spans: Mapping[int, int]) -> Self:
        """Return all samples except first..last-1 of each span, first -> last, with a gap in its place.

        `flat` is kept if it lies before them.
        """
        spans = {max(first, 0): last for first, last in spans.items() if max(first, 0) < min(last, len(self))}
        kept = Samples.joined([*without([self.at(slice(None))], spans)])
        flat = self.flat if self.flat is not None and self.flat[1] <= min(spans, default=len(self)) else None
        interrupted = (*self.interrupted, *self.t[list(spans)].tolist())
        return replace(self, flat=flat, interrupted=interrupted, **vars(kept))

    def interrupted_at(self, *times_s: float) -> Self:
        """Return the recording with further times of interruptions, and so the other IMUs of its vehicle."""
        others = tuple(other.interrupted_at(*times_s) for other in self.others)
        return replace(self, interrupted=(*self.interrupted, *times_s), others=others)


def without(runs: Iterable[Samples], spans: Mapping[int, int]) -> Iterator[Samples]:
    """Yield all samples of runs except first..last-1 of each span, first -> last, with a gap in its place."""
    at, cut = 0, False
    for samples in runs:
        number = np.arange(at, at + len(samples))
        kept = np.ones(len(samples), bool)
        for first, last in spans.items():
            kept &= (number < first) | (number >= last)
        gap = samples.gap | (kept & ~np.concatenate(([not cut], kept[:-1])))
        at, cut = at + len(samples), not kept[-1]
        if kept.any():
            yield replace(samples, gap=gap).at(kept)


def clock_of(stamps: Vector, sensor: Sensor) -> Clock:
    """Return the clock behind stamps (n,) s of samples; those of an autopilot, or of few samples, are their times."""
    is_own = sensor.origin is Origin.VEHICLE or len(stamps) < FEWEST
    with np.errstate(over="ignore"):
        is_own = is_own or bool((np.diff(stamps) < 0).any())
        return Clock(stamps, np.zeros(len(stamps), bool), 0.0) if is_own else fit_clock(stamps)


def _same(one: Any, other: Any) -> bool:
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other, equal_nan=one.dtype.kind == "f")
    return bool(one == other)
