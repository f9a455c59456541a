"""Attributes of IIO devices as texts, and their meaning: units, ranges, mounting, name, and the frames of a buffer.

Source: Linux Documentation/ABI/testing/sysfs-bus-iio: (raw + offset) * scale is m/s^2, rad/s or thousandths of a
degree Celsius; a mount matrix rotates the samples into the frame of the product that contains the sensor.
scan_elements: index, type; drivers/iio/industrialio-buffer.c, iio_compute_scan_bytes: each element is
aligned to its own size, a frame to its largest.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..chip.families import MPU6050, part_named
from ..chip.registers import ACCEL_RANGES_G, GYRO_RANGES_DPS, mps2_per_lsb, rad_s_per_lsb
from ..data import AXES, STANDARD_GRAVITY_MPS2, Vector
from ..errors import ChipError

TYPE = re.compile(r"(be|le):([su])(\d+)/(8|16|32|64)(?:X(\d+))?>>(\d+)")


@dataclass(frozen=True)
class ScanElement:
    """Channel of a frame.

    Attributes
    ----------
    name : such as in_accel_x. index : its order among the channels. order : byte order < or >, as in NumPy.
    signed, bits, shift : the value has `bits` bits, `shift` bits above the lowest stored one.
    stored_bytes : of one value. repeat : number of consecutive values.
    """

    name: str
    index: int
    order: str
    signed: bool
    bits: int
    stored_bytes: int
    shift: int
    repeat: int = 1

    @classmethod
    def parse(cls, name: str, index: str, text: str) -> Self:
        """Parse the attributes `index` and `type`, such as le:s16/16>>0.

        Raises
        ------
        ChipError : another form of text.
        """
        found = TYPE.fullmatch(text.strip())
        if found is not None and index.strip().isdecimal():
            order, sign = found.group(1, 2)
            bits, stored, repeat, shift = (int(digits or 1) for digits in found.group(3, 4, 5, 6))
            if 0 < bits <= stored - shift and repeat > 0:
                return cls(
                    name, int(index), "<" if order == "le" else ">", sign == "s", bits, stored // 8, shift, repeat
                )
        raise ChipError(
            f"the driver describes the storage of {name} as {text.strip()!r}, which is unknown",
            "report it with the kernel's version",
        )

    @property
    def bytes(self) -> int:
        """Size in the frame; its position is a multiple of this."""
        return self.stored_bytes * self.repeat

    def values(self, stored: NDArray[np.unsignedinteger]) -> NDArray[np.int64]:
        """Decode the stored values (n,); the first of several consecutive ones."""
        one = stored.astype(np.uint64) if self.repeat == 1 else stored[:, 0].astype(np.uint64)
        held = (one >> np.uint64(self.shift)) & np.uint64((1 << self.bits) - 1)
        if not self.signed:
            return held.astype(np.int64)
        up = np.uint64(64 - self.bits)
        return np.asarray((held << up).view(np.int64) >> np.int64(up))


class FrameLayout:
    """Positions of the elements in a frame."""

    def __init__(self, elements: Iterable[ScanElement]) -> None:
        self.elements = sorted(elements, key=lambda element: element.index)
        at, places = 0, []
        for element in self.elements:
            at += -at % element.bytes
            places.append(at)
            at += element.bytes
        self.frame_bytes = at + -at % max(element.bytes for element in self.elements)
        self._dtype = np.dtype(
            {
                "names": [element.name for element in self.elements],
                "formats": [
                    (f"{e.order}u{e.stored_bytes}", (e.repeat,)) if e.repeat > 1 else f"{e.order}u{e.stored_bytes}"
                    for e in self.elements
                ],
                "offsets": places,
                "itemsize": self.frame_bytes,
            }
        )

    def columns(self, data: bytes) -> Mapping[str, NDArray[np.int64]]:
        """Decode n frames to counts (n,) of each channel.

        Raises
        ------
        ChipError : the bytes are not a whole number of frames.
        """
        if len(data) % self.frame_bytes:
            raise ChipError(
                f"the kernel's buffer returned {len(data)} bytes, but a frame has {self.frame_bytes}",
                "report it with the kernel's version",
            )
        frames = np.frombuffer(data, self._dtype)
        return {element.name: element.values(frames[element.name]) for element in self.elements}

    def packed(self, columns: Mapping[str, NDArray[np.int64]]) -> bytes:
        """Encode whole counts (n,) of each channel to frames; channels must not be shifted or repeated."""
        frames = np.zeros(len(next(iter(columns.values()))), self._dtype)
        for element in self.elements:
            frames[element.name] = np.asarray(columns[element.name]).astype(np.int64).astype(f"u{element.stored_bytes}")
        return frames.tobytes()


ACCEL, GYRO, TEMP, TIMESTAMP = "in_accel", "in_anglvel", "in_temp", "in_timestamp"
KINDS = {ACCEL: "accelerometer", GYRO: "gyroscope"}
# Bits of an MPU's count, if there is no buffer to describe them.
USUAL_BITS = np.iinfo(np.int16).bits
# Plausible full scales: g, deg/s.
PLAUSIBLE_RANGES = {ACCEL: (1.0, 1000.0), GYRO: (50.0, 20000.0)}
# Drivers round their scales to 0.1 %.
SCALE_TOLERANCE = 0.005
# Units of a count at each range of an MPU: by the data sheet, and as inv_mpu6050 prints them (Linux 6.1,
# inv_mpu_core.c, accel_scale and gyro_scale_6050): 0.07 to 0.09 % less, 0.11 % for the gyroscope.
MPU_SCALES = {
    ACCEL: tuple(mps2_per_lsb(code) for code in range(len(ACCEL_RANGES_G))),
    GYRO: tuple(rad_s_per_lsb(code) for code in range(len(GYRO_RANGES_DPS))),
}
PRINTED_SCALES = {
    ACCEL: (0.000598, 0.001196, 0.002392, 0.004785),
    GYRO: (0.000133090, 0.000266181, 0.000532362, 0.001064724),
}

Texts = Mapping[str, str]


@dataclass(frozen=True)
class SensorScale:
    """Scale of the three axes of a sensor: `kind` is ACCEL or GYRO.

    Attributes
    ----------
    scale, offset : (3,) (raw + offset) * scale is in m/s^2 or rad/s; of an MPU, the data sheet's scale, to which all
        calibrations of such a chip refer. printed : (3,) the driver's scale. bits : of a count; None: unknown.
    """

    kind: str
    scale: Vector
    printed: Vector
    offset: Vector
    bits: int | None

    @property
    def full_scale(self) -> float | None:
        """Full scale in g or deg/s, as in a data sheet; None if the bits are unknown."""
        if self.bits is None:
            return None
        return full_scale(self.kind, float(self.scale.max()), self.bits)

    def clipped(self, counts: Vector) -> Vector:
        """Return (n,) 1.0 if one of `counts` (n, 3) is at the end of its range, else 0.0."""
        if self.bits is None:
            return np.zeros(len(counts))
        most = 2.0 ** (self.bits - 1) - 1
        return np.asarray(((counts >= most) | (counts <= -most - 1)).any(axis=1), np.float64)


def full_scale(kind: str, scale: float, bits: int) -> float:
    """Return g or deg/s at the largest count, rounded to a whole number if it is nearly one."""
    value = scale * 2 ** (bits - 1)
    value = value / STANDARD_GRAVITY_MPS2 if kind == ACCEL else math.degrees(value)
    return float(round(value)) if abs(value - round(value)) < SCALE_TOLERANCE * value else value


def bits_of(kind: str, texts: Texts, elements: Mapping[str, ScanElement]) -> int | None:
    """Return the bits of a count; None if neither the buffer nor the part's name tells them."""
    first = elements.get(f"{kind}_x")
    return first.bits if first is not None else USUAL_BITS if part_named(texts.get("name")) is not None else None


def read_scale(kind: str, device: str, texts: Texts, elements: Mapping[str, ScanElement]) -> SensorScale:
    """Read the scale from a device's attributes.

    Raises
    ------
    ChipError : a scale that is not a number, or not plausible.
    """
    printed, offset = (
        np.array([read_number(texts, f"{kind}_{axis}_{what}", f"{kind}_{what}", default=0.0) for axis in AXES])
        for what in ("scale", "offset")
    )
    bits = bits_of(kind, texts, elements)
    low, high = PLAUSIBLE_RANGES[kind]
    if not (printed > 0).all() or (
        bits is not None and not low <= full_scale(kind, float(printed.max()), bits) <= high
    ):
        scales = ", ".join(f"{value:g}" for value in printed)
        raise ChipError(
            f"the scale of the {KINDS[kind]} of {device} is {scales}, which is not plausible",
            f"correct {kind}_scale in /sys/bus/iio/devices/{device}",
        )
    is_mpu = part_named(texts.get("name")) is not None
    scale = np.array([_mpu_scale(kind, value) for value in printed.tolist()]) if is_mpu else printed
    return SensorScale(kind, scale, printed, offset, bits)


def _mpu_scale(kind: str, printed: float) -> float:
    """Return the data sheet's scale if `printed` is one of them, rounded by a driver; else `printed`."""
    near = (scale for scale in MPU_SCALES[kind] if abs(printed - scale) < SCALE_TOLERANCE * scale)
    return next(near, printed)


def read_number(texts: Texts, *names: str, default: float) -> float:
    """Read the number of the first of `names` that the device has; `default` without one.

    Raises
    ------
    ChipError : a text that is not a finite number.
    """
    name = next((name for name in names if name in texts), None)
    return default if name is None else parse_number(name, texts[name])


def parse_number(name: str, text: str) -> float:
    """Parse the `text` of the attribute `name`; see read_number."""
    with suppress(ValueError):
        if math.isfinite(value := float(text)):
            return value
    raise ChipError(f"{name} is {text!r}, which is not a number", "report it with the kernel's version")


def chip_name(texts: Texts) -> str:
    """Return the chip's name."""
    part = part_named(texts.get("name"))
    name = "".join(c if c.isalnum() else "-" for c in texts.get("name", "")).strip("-").upper()
    return part.chip if part is not None else name[:60] or "IIO"


def mount_matrix(texts: Texts, kind: str) -> Vector:
    """Read the mount matrix (3, 3) of the sensor; the identity without one.

    Raises
    ------
    ChipError : a text that is not an invertible matrix.
    """
    name = next((n for n in (f"{kind}_mount_matrix", "in_mount_matrix", "mount_matrix") if n in texts), None)
    if name is None:
        return np.eye(3)
    with suppress(ValueError):
        matrix = np.array([[float(v) for v in row.split(",")] for row in texts[name].split(";")]).reshape(3, 3)
        # Its determinant is that of a rotation or of a mirror, but for a calibration that it contains.
        if 0.1 < abs(np.linalg.det(matrix)) < 10:
            return matrix
    raise ChipError(f"{name} is {texts[name]!r}, which is not a mount matrix", "correct the device tree")


def read_calibbias(texts: Texts) -> tuple[int, int, int] | None:
    """Return calibbias, the words of an MPU-6050's offset registers; None without it.

    For the other families the driver reads y and z at wrong addresses.
    """
    words = [texts.get(f"{ACCEL}_{axis}_calibbias", "") for axis in AXES]
    part = part_named(texts.get("name"))
    if part is None or part.family is not MPU6050 or not all(word.lstrip("-").isdecimal() for word in words):
        return None
    x, y, z = map(int, words)
    return x, y, z


def parse_available(text: str) -> list[float]:
    """Parse the values of an `_available` attribute; for [least step most], the ends."""
    words = text.strip().strip("[]").split()
    try:
        values = [float(word) for word in words]
    except ValueError:
        return []
    return [values[0], values[2]] if text.strip().startswith("[") and len(values) == 3 else values
