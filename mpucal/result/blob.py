"""The config blob: a calibration for firmware, encoded and decoded as firmware_protocol.md specifies."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import islice
from typing import Any

MAGIC = b"MPUC"
MAJOR = 1
MAX_LENGTH = 256
FORMULA = "a = inv(D) @ (y - b_a + applied_b_a)"

# firmware_protocol.md, "Layout": the numbers behind the header, by the minor version that appended them: the field of a
# Blob, its code for struct, and the count of its numbers
HEADER = "<4s B B H 40s"
LAYOUT = (
    (
        *(
            ("who_am_i", "B 3x", 1),
            ("accel_range_g", "f", 1),
            ("gyro_range_dps", "f", 1),
            ("D", "f", 9),
            ("b_a", "f", 3),
        ),
        *(("gravity", "f", 1), ("created", "Q", 1), ("temperature_c", "f", 1), ("applied_b_a", "f", 3), ("K", "f", 9)),
        ("b_omega", "f", 3),
    ),
    (("b_a_slope", "f", 3), ("temperature_range_c", "f", 2)),
    (("gyro_counts", "f", 1),),
)
# the fields of each minor version, and of those before it
FIELDS = [[row for rows in LAYOUT[: minor + 1] for row in rows] for minor in range(len(LAYOUT))]
FORMATS = [
    struct.Struct(" ".join([HEADER, *(f"{count if count > 1 else ''}{code}" for _, code, count in rows)]))
    for rows in FIELDS
]
CHECKSUM = struct.Struct("<I")
LENGTHS = [form.size + CHECKSUM.size for form in FORMATS]

# limits of a matrix' largest element, or its inverse, and of its determinant over the cube of that element
MOST_GAIN, LEAST_DETERMINANT = 1e3, 1e-6


class BlobError(ValueError):
    """Bytes that are not a config blob, or values that do not fit into one."""


@dataclass(frozen=True)
class Blob:
    """Content of a config blob.

    Attributes
    ----------
    who_am_i : the chip's WHO_AM_I; 0 unknown.
    accel_range_g, gyro_range_dps : full scale; 0 unknown.
    D : 9 numbers, row-major. b_a : 3, m/s^2: a = inv(D) (y - b_a + applied_b_a).
    gravity : m/s^2, to which D refers; NaN unknown.
    temperature_c : of the measurement; NaN unknown.
    created : ISO 8601, UTC if it has no offset, in whole seconds; empty: unknown.
    applied_b_a : m/s^2 that the chip's offset registers subtract already.
    K : 9 numbers, row-major. b_omega : 3, rad/s: w = K (y - b_omega); NaN if not estimated.
    b_a_slope : 3, m/s^2 per degree Celsius: b_a(T) = b_a + b_a_slope (T - temperature_c); zeros: not known.
    temperature_range_c : 2, to which T is clipped; NaN without b_a_slope.
    gyro_counts : counts of the gyroscope at gyro_range_dps, to which K and b_omega refer; None in minor versions 0 and
        1, which lack it and refer to GYRO_COUNTS.
    """

    who_am_i: int
    accel_range_g: float
    gyro_range_dps: float
    D: tuple[float, ...]
    b_a: tuple[float, ...]
    gravity: float
    temperature_c: float
    created: str
    applied_b_a: tuple[float, ...]
    K: tuple[float, ...]
    b_omega: tuple[float, ...]
    b_a_slope: tuple[float, ...] = (0.0, 0.0, 0.0)
    temperature_range_c: tuple[float, ...] = (math.nan, math.nan)
    gyro_counts: float | None = None

    def encode(self) -> bytes:
        """Return the blob's bytes.

        Raises
        ------
        BlobError : D, b_a or applied_b_a is not finite, or a value does not fit its field.
        """
        _check_usable(self)
        minor = 2 if self.gyro_counts is not None else 1 if any(self.b_a_slope) else 0
        values = {**vars(self), "created": _unix_seconds(self.created)}
        numbers = [each for name, _, n in FIELDS[minor] for each in (values[name] if n > 1 else (values[name],))]
        try:
            body = FORMATS[minor].pack(MAGIC, MAJOR, minor, LENGTHS[minor], FORMULA.encode(), *numbers)
        except (struct.error, OverflowError) as error:
            raise BlobError(f"a value does not fit its field ({error})") from error
        return body + CHECKSUM.pack(zlib.crc32(body))

    @classmethod
    def decode(cls, data: bytes) -> Blob:
        """Return the values of one whole blob; fields that a newer minor version appended are skipped.

        Raises
        ------
        BlobError : too short, another magic, major version or length, damaged, or not usable.
        """
        _check_whole(data)
        minor = max(minor for minor, length in enumerate(LENGTHS) if length <= len(data))
        numbers = iter(FORMATS[minor].unpack_from(data)[5:])
        values: dict[str, Any] = {
            name: tuple(islice(numbers, n)) if n > 1 else next(numbers) for name, _, n in FIELDS[minor]
        }
        values["created"] = _iso_8601(values["created"])
        blob = cls(**values)
        low, high = blob.temperature_range_c
        # a slope that cannot be used is none
        if not (all(map(math.isfinite, blob.b_a_slope)) and -math.inf < low <= blob.temperature_c <= high < math.inf):
            blob = replace(blob, b_a_slope=Blob.b_a_slope, temperature_range_c=Blob.temperature_range_c)
        _check_usable(blob)
        return blob


def _check_whole(data: bytes) -> None:
    """Make the checks of firmware_protocol.md, "Reading", in its order."""
    if len(data) < CHECKSUM.size + len(MAGIC):
        raise BlobError(f"{len(data)} bytes are too short for a blob")
    magic, major, _minor, length = struct.unpack_from("<4s B B H", data)
    if magic != MAGIC:
        raise BlobError(f"it begins with {magic!r}, not {MAGIC!r}")
    if major != MAJOR:
        raise BlobError(f"its layout has major version {major}, but only {MAJOR} is known")
    if not LENGTHS[0] <= length <= MAX_LENGTH:
        raise BlobError(f"its length field is {length}, but {LENGTHS[0]} to {MAX_LENGTH} are allowed")
    if length != len(data):
        raise BlobError(f"its length field is {length}, but it has {len(data)} bytes")
    (checksum,) = CHECKSUM.unpack_from(data, length - CHECKSUM.size)
    if checksum != zlib.crc32(data[: length - CHECKSUM.size]):
        raise BlobError("its checksum does not match: it is damaged")


def _check_usable(blob: Blob) -> None:
    for name, _, count in FIELDS[1]:
        if count == 1:
            continue
        values = getattr(blob, name)
        if len(values) != count:
            raise BlobError(f"{name} has {len(values)} numbers, not {count}")
        if name in ("D", "b_a", "applied_b_a") and not all(map(math.isfinite, values)):
            raise BlobError(f"{name} holds a number that is not finite")
    if not is_invertible(blob.D):
        raise BlobError("D has no inverse")
    for name in ("accel_range_g", "gyro_range_dps"):
        if not 0.0 <= getattr(blob, name) < math.inf:
            raise BlobError(f"{name} is {getattr(blob, name)}, which is neither a range nor 0")
    if blob.gyro_counts is not None and not 0.0 < blob.gyro_counts < math.inf:
        raise BlobError(f"gyro_counts is {blob.gyro_counts}, which is not a number of counts")


def is_invertible(matrix: Iterable[float]) -> bool:
    """Return True if nine numbers, by row, are a matrix that a calibration may hold: every reader inverts it."""
    a, b, c, d, e, f, g, h, i = numbers = tuple(matrix)
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    most = max(map(abs, numbers))
    return 1 / MOST_GAIN <= most <= MOST_GAIN and abs(determinant) > LEAST_DETERMINANT * most**3


def _unix_seconds(created: str) -> int:
    if not created:
        return 0
    try:
        time = datetime.fromisoformat(created)
    except ValueError as error:
        raise BlobError(f"created is not an ISO 8601 time ({error})") from error
    if time.tzinfo is None:
        time = time.replace(tzinfo=UTC)
    return math.floor(time.timestamp())


def _iso_8601(seconds: int) -> str:
    if not seconds:
        return ""
    try:
        return datetime.fromtimestamp(seconds, UTC).isoformat()
    except (ValueError, OverflowError, OSError) as error:
        raise BlobError(f"its time, {seconds} s since 1970, is out of range") from error
