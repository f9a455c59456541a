"""The attributes of IIO devices as texts, and what they say of a sensor: units, ranges, mounting, name.

Source: Linux Documentation/ABI/testing/sysfs-bus-iio: (raw + offset) * scale is m/s^2, rad/s or thousandths of a
degree Celsius; a mount matrix turns what is measured into the frame of the device that it is built into.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..chip.families import PARTS, Part
from ..data import STANDARD_GRAVITY_MPS2, Vector
from ..errors import ChipError
from .scan_elements import ScanElement

AXES = "xyz"
ACCEL, GYRO, TEMP, TIMESTAMP = "in_accel", "in_anglvel", "in_temp", "in_timestamp"
KINDS = {ACCEL: "accelerometer", GYRO: "gyroscope"}
# counts of an MPU where no buffer says it
USUAL_BITS = 16
# what counts as full scale of such sensors: g, deg/s
PLAUSIBLE = {ACCEL: (1.0, 1000.0), GYRO: (50.0, 20000.0)}
# a driver rounds its scales to 0.1 %
ROUNDED = 0.005

Texts = Mapping[str, str]


@dataclass(frozen=True)
class Group:
    """The three axes of one sensor: `kind` is ACCEL or GYRO.

    Attributes
    ----------
    scale, offset : (3,) (raw + offset) * scale is in m/s^2 or rad/s. bits : of a count; None: nobody says.
    """

    kind: str
    scale: Vector
    offset: Vector
    bits: int | None

    @property
    def full_scale(self) -> float | None:
        """In g or deg/s, as a data sheet names it; None where the bits are not known."""
        if self.bits is None:
            return None
        return full_scale(self.kind, float(self.scale.max()), self.bits)

    def clipped(self, counts: Vector) -> Vector:
        """(n,) 1.0 where one of `counts` (n, 3) stands at the end of its range, else 0.0."""
        if self.bits is None:
            return np.zeros(len(counts))
        most = 2.0 ** (self.bits - 1) - 1
        return np.asarray(((counts >= most) | (counts <= -most - 1)).any(axis=1), np.float64)


def full_scale(kind: str, scale: float, bits: int) -> float:
    """g or deg/s at the last count; a whole number where it is nearly one."""
    value = scale * 2 ** (bits - 1)
    value = value / STANDARD_GRAVITY_MPS2 if kind == ACCEL else math.degrees(value)
    return float(round(value)) if abs(value - round(value)) < ROUNDED * value else value


def bits_of(kind: str, texts: Texts, elements: Mapping[str, ScanElement]) -> int | None:
    """Of a count; None where neither the buffer nor the part's name says it."""
    first = elements.get(f"{kind}_x")
    return first.bits if first is not None else USUAL_BITS if part_of(texts) is not None else None


def group(kind: str, device: str, texts: Texts, elements: Mapping[str, ScanElement]) -> Group:
    """Of a device's attributes.

    Raises
    ------
    ChipError : a scale that is none, or of which no such sensor is.
    """
    scale = np.array([number(texts, kind, axis, "scale", 0.0) for axis in AXES])
    offset = np.array([number(texts, kind, axis, "offset", 0.0) for axis in AXES])
    bits = bits_of(kind, texts, elements)
    low, high = PLAUSIBLE[kind]
    wrong = not (np.isfinite(scale) & (scale > 0)).all()
    if wrong or (bits is not None and not low <= full_scale(kind, float(scale.max()), bits) <= high):
        said = ", ".join(f"{value:g}" for value in scale)
        raise ChipError(
            f"the scale of the {KINDS[kind]} of {device} is {said}, which no such sensor has",
            f"look at {kind}_scale in /sys/bus/iio/devices/{device}, and write it anew",
        )
    return Group(kind, scale, offset, bits)


def number(texts: Texts, kind: str, axis: str, what: str, otherwise: float) -> float:
    """Of an axis, or of all axes of a kind; NaN where it is no number."""
    for name in (f"{kind}_{axis}_{what}", f"{kind}_{what}"):
        if name in texts:
            try:
                return float(texts[name])
            except ValueError:
                return math.nan
    return otherwise


def part_of(texts: Texts) -> Part | None:
    """The part of our table that a device is named after."""
    name = texts.get("name", "").lower()
    return next((part for part in PARTS.values() if part.chip.replace("-", "").lower() == name), None)


def chip(texts: Texts) -> str:
    """What to call it."""
    part = part_of(texts)
    name = "".join(c if c.isalnum() else "-" for c in texts.get("name", "")).strip("-").upper()
    return part.chip if part is not None else name[:60] or "IIO"


def mount_matrix(texts: Texts, kind: str) -> Vector:
    """(3, 3) of the sensor; the identity where none is said.

    Raises
    ------
    ChipError : a text that is no matrix.
    """
    name = next((n for n in (f"{kind}_mount_matrix", "in_mount_matrix", "mount_matrix") if n in texts), None)
    if name is None:
        return np.eye(3)
    try:
        return np.array([[float(v) for v in row.split(",")] for row in texts[name].split(";")]).reshape(3, 3)
    except ValueError as error:
        raise ChipError(f"{name} is {texts[name]!r}, which is no matrix", "mend the device tree") from error


def available(text: str) -> list[float]:
    """The values that a text of an `_available` attribute lists; of [least step most] the ends."""
    words = text.strip().strip("[]").split()
    try:
        values = [float(word) for word in words]
    except ValueError:
        return []
    return [values[0], values[2]] if text.strip().startswith("[") and len(values) == 3 else values
