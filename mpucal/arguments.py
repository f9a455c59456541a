"""Checks of callers' arguments: arrays, times, numbers and paths."""

from __future__ import annotations

import math
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from numbers import Real
from operator import index
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import ArraysError, RecordingError, SourceError, WrongType, WrongValue

# s: limits of times and their steps, within which no product overflows
SHORTEST_S, LONGEST_S = 1e-12, 1e18
# m/s^2 and rad/s: beyond any sensor, and with finite squares
LARGEST = 1e9
# m/s^2: limits of a local gravity, from small moons to centrifuges
LEAST_GRAVITY_MPS2, MOST_GRAVITY_MPS2 = 1e-3, 1e4
# m/s^2: limits on Earth, from mountains on the equator to the poles (GRS 80: 9.780 and 9.832 at sea level)
LEAST_ON_EARTH_MPS2, MOST_ON_EARTH_MPS2 = 9.76, 9.84

# remedy for times that do not increase
UNSORTED = "sort the samples by time and drop repeated ones; if another recording begins there, give each by itself"

Vector = NDArray[np.float64]
Mask = NDArray[np.bool_]
Whole = NDArray[np.int64]


def check_numbers(values: ArrayLike, key: str, name: str, as_given: bool = False) -> Any:
    """Return an array of numbers, copied as float64; `as_given` : of their own type, such as dates."""
    try:
        array = np.asarray(values)
        return array if as_given else _real(array).copy()
    except (TypeError, ValueError) as error:
        raise ArraysError(f"{name}: {key} holds values that are not numbers ({error})", "give numbers") from error


def check_column(values: ArrayLike, key: str, n: int, name: str) -> Vector:
    """Return (n,), one value per sample."""
    array: Vector = check_numbers(values, key, name)
    if array.shape != (n,):
        raise ArraysError(f"{name}: {key} has shape {array.shape}, not ({n},)", "give one value per sample")
    return array


def check_mask(values: ArrayLike | None, key: str, n: int, name: str) -> Mask:
    """Return (n,) bool; False if nothing is given."""
    return np.zeros(n, bool) if values is None else check_column(values, key, n, name).astype(bool)


def check_rows(values: ArrayLike, key: str, n: int, name: str) -> Vector:
    """Return (n, 3) finite numbers."""
    array: Vector = check_numbers(values, key, name)
    if array.shape != (n, 3):
        raise ArraysError(f"{name}: {key} has shape {array.shape}, not ({n}, 3)", "give one row of x, y, z per sample")
    bad = ~is_plausible(array).all(axis=1)
    if bad.any():
        raise ArraysError(
            f"{name}: {key} is not a finite number in {int(bad.sum())} of {n} samples,"
            f" first in sample {int(bad.argmax())}",
            "leave those samples out, and keep the times of the others",
        )
    return array


def is_plausible(values: ArrayLike) -> Mask:
    """Return True for each number that a sensor may have read: neither infinite nor beyond LARGEST."""
    return np.asarray(np.abs(values) <= LARGEST)


def to_seconds(times: ArrayLike, name: str) -> Vector:
    """Return times (n,) s; dates become the time since the first one.

    Raises
    ------
    ArraysError : they are not times.
    """
    given = check_numbers(times, "t", name, as_given=True)
    if given.dtype.kind == "M" and given.size:
        given = given - given.flat[0]
    t: Vector = given / np.timedelta64(1, "s") if given.dtype.kind == "m" else check_numbers(given, "t", name)
    if t.ndim != 1 or len(t) < 2:
        raise ArraysError(f"{name}: t has shape {t.shape}, not (n,) with n >= 2", "give one time in seconds per sample")
    if not np.isfinite(t).all():
        raise ArraysError(f"{name}: t is not a finite number everywhere", "give times in seconds")
    return t


def check_increasing(t: Vector, name: str) -> Vector:
    """Return times (n,) s, which increase.

    Raises
    ------
    ArraysError : they do not.
    """
    with np.errstate(over="ignore"):
        steps, most = np.diff(t), t[-1] - t[0]
    if (steps <= 0).any():
        i = int((steps <= 0).argmax()) + 1
        raise ArraysError(
            f"{name}: time does not increase at sample {i} ({t[i - 1]:.6f} s, then {t[i]:.6f} s)",
            UNSORTED,
        )
    if steps.min() < SHORTEST_S or not most < LONGEST_S:
        raise ArraysError(f"{name}: t has steps of {steps.min():g} s within {most:g} s", "give times in seconds")
    return t


def check_flat(flat: Any, n: int, name: str) -> tuple[int, int]:
    """Return (first, last + 1) of a part of n samples.

    Raises
    ------
    ArraysError : it is not such a pair.
    """
    remedy = "give (first, last + 1) of the samples that lie flat, or leave it out"
    try:
        first, last = (index(end) for end in flat)
    except (TypeError, ValueError) as error:
        raise ArraysError(f"{name}: flat is {flat!r}, not two whole numbers", remedy) from error
    if not 0 <= first < last <= n:
        raise ArraysError(f"{name}: flat = ({first}, {last}) does not lie within its {n} samples", remedy)
    return first, last


def check_vectors(values: ArrayLike, name: str, unit: str) -> Vector:
    """Return (..., 3) numbers of x, y, z, to which a calibration is applied.

    Raises
    ------
    WrongType : they are not numbers. WrongValue : the last axis is not x, y, z.
    """
    array = _numbers(values, name, f"give (..., 3) {unit}")
    if array.ndim == 0 or array.shape[-1] != 3:
        turned = f"{name}.T" if array.ndim == 2 and len(array) == 3 else "one row of x, y, z per sample"
        raise WrongValue(f"{name} has shape {array.shape}, not (..., 3)", f"give {turned}, in {unit}")
    return array


def check_path(path: Any, what: str) -> Path:
    """Return the path of `what`.

    Raises
    ------
    WrongType : it is not a path. WrongValue : it cannot be the name of a file.
    """
    if not isinstance(path, str | PathLike):
        raise WrongType(f"{what} is given as {type(path).__name__}", "give the path of its file")
    if "\0" in str(path):
        raise WrongValue(f"{what} is given as {str(path)!r}", "give the path of its file")
    return Path(path)


def check_number(value: Any, what: str, wanted: str, least: float = -math.inf) -> float:
    """Return a finite number, `least` or more.

    Raises
    ------
    WrongType : it is not a number. WrongValue : it is smaller, or not finite.
    """
    if not isinstance(value, Real) or isinstance(value, bool):
        raise WrongType(f"{what} is {value!r}", f"give {wanted}")
    if not math.isfinite(value) or value < least:
        raise WrongValue(f"{what} is {value}", f"give {wanted}")
    return float(value)


def check_shape(values: ArrayLike, name: str, *shapes: tuple[int, ...]) -> Vector:
    """Return numbers of one of the shapes; messages name the first shape.

    Raises
    ------
    WrongType : they are not numbers. WrongValue : another shape.
    """
    remedy = f"give numbers of shape {shapes[0]}"
    array = _numbers(values, name, remedy)
    if array.shape not in shapes:
        raise WrongValue(f"{name} has shape {array.shape}", remedy)
    return array


def _numbers(values: ArrayLike, name: str, remedy: str) -> Vector:
    try:
        return _real(np.asarray(values))
    except (TypeError, ValueError) as error:
        raise WrongType(f"{name} is not an array of numbers ({error})", remedy) from error


def check_regular(path: Path) -> Path:
    """Return `path` if it is a file, a folder, or does not exist.

    Raises
    ------
    RecordingError : it is a pipe, a socket or a device, which may never end.
    """
    try:
        mode = path.stat().st_mode
    except OSError:
        return path
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise RecordingError(f"{path} is a pipe or device, not a file", "save its data to a file, and give that")
    return path


@contextmanager
def reading(path: Path, kind: type[SourceError] = RecordingError) -> Iterator[None]:
    """Turn an OSError of the block into an error of this kind that names `path`."""
    try:
        yield
    except OSError as error:
        raise kind(f"cannot read {path} ({error.strerror or error})", "check the path and its permissions") from error


def read_limited(path: Path, most: int) -> bytes:
    """Return the bytes of a file that is not longer than `most`.

    Raises
    ------
    RecordingError : it cannot be read, is not a file, or is longer.
    """
    with reading(path), check_regular(path).open("rb") as file:
        data = file.read(most + 1)
    if len(data) > most:
        raise RecordingError(
            f"{path} is longer than {most >> 20} MB" if most >> 20 else f"{path} is longer than {most} bytes",
            "give a file that mpucal wrote",
        )
    return data


def _real(array: NDArray[Any]) -> Vector:
    """Return float64; times and complex numbers are refused."""
    if array.dtype.kind in "mMc":
        raise TypeError("they are complex" if array.dtype.kind == "c" else "they are times")
    # too large a number becomes infinite, and a signalling NaN a quiet one
    with np.errstate(over="ignore", invalid="ignore"):
        return array.astype(np.float64, copy=False)
