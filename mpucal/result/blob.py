"""The config blob: a calibration for firmware, encoded and decoded as firmware_protocol.md specifies."""

from __future__ import annotations

import math
import struct
import zlib
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import islice
from typing import Any

MAGIC = b"MPUC"
MAJOR = 1
MAX_LENGTH = 256
FORMULA = "a = inv(D) @ (y - b_a + applied_b_a)"

# firmware_protocol.md, "Layout": fields of minor version 0, those appended by 1 and by 2, and the checksum
FIELDS = struct.Struct("<4s B B H 40s B 3x f f 9f 3f f Q f 3f 9f 3f")
# the numbers of FIELDS behind the formula, in their order
LAYOUT = (
    *(("who_am_i", 1), ("accel_range_g", 1), ("gyro_range_dps", 1), ("D", 9), ("b_a", 3), ("gravity", 1)),
    *(("created", 1), ("temperature_c", 1), ("applied_b_a", 3), ("K", 9), ("b_omega", 3)),
)
SLOPE = struct.Struct("<3f 2f")
COUNTS = struct.Struct("<f")
CHECKSUM = struct.Struct("<I")
LENGTH = FIELDS.size + CHECKSUM.size
LENGTH_WITH_SLOPE = LENGTH + SLOPE.size
LENGTH_WITH_COUNTS = LENGTH_WITH_SLOPE + COUNTS.size
HEADER_LENGTH = 8

APPENDED = (("b_a_slope", 3), ("temperature_range_c", 2))
NO_SLOPE, NO_RANGE = (0.0, 0.0, 0.0), (math.nan, math.nan)

# limits of D's largest element, and of its determinant over the cube of that element
LEAST_GAIN, MOST_GAIN = 1e-3, 1e3
LEAST_DETERMINANT = 1e-6

MAJOR_AT = 4
LENGTH_AT = 6


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
    b_a_slope: tuple[float, ...] = NO_SLOPE
    temperature_range_c: tuple[float, ...] = NO_RANGE
    gyro_counts: float | None = None

    def encode(self) -> bytes:
        """Return the blob's bytes.

        Raises
        ------
        BlobError : D, b_a or applied_b_a is not finite, or a value does not fit its field.
        """
        _check_usable(self)
        values = {**vars(self), "created": _unix_seconds(self.created)}
        numbers = [each for name, count in LAYOUT for each in (values[name] if count > 1 else (values[name],))]
        try:
            minor, appended = self._encode_appended()
            body = FIELDS.pack(MAGIC, MAJOR, minor, LENGTH + len(appended), FORMULA.encode(), *numbers)
        except (struct.error, OverflowError) as error:
            raise BlobError(f"a value does not fit its field ({error})") from error
        body += appended
        return body + CHECKSUM.pack(zlib.crc32(body))

    def _encode_appended(self) -> tuple[int, bytes]:
        """Return the minor version and the fields appended to those of version 0."""
        slope = SLOPE.pack(*self.b_a_slope, *self.temperature_range_c)
        if self.gyro_counts is not None:
            return 2, slope + COUNTS.pack(self.gyro_counts)
        return (1, slope) if any(self.b_a_slope) else (0, b"")

    @classmethod
    def decode(cls, data: bytes) -> Blob:
        """Return the values of one whole blob; fields that a newer minor version appended are skipped.

        Raises
        ------
        BlobError : too short, another magic, major version or length, damaged, or not usable.
        """
        _check_whole(data)
        numbers = iter(FIELDS.unpack_from(data)[5:])
        values: dict[str, Any] = {
            name: tuple(islice(numbers, count)) if count > 1 else next(numbers) for name, count in LAYOUT
        }
        values["created"] = _iso_8601(values["created"])
        slope, range_c = _slope(data, values["temperature_c"])
        blob = cls(**values, b_a_slope=slope, temperature_range_c=range_c, gyro_counts=_gyro_counts(data))
        _check_usable(blob)
        return blob


def _check_whole(data: bytes) -> None:
    """Make the checks of firmware_protocol.md, "Reading", in its order."""
    if len(data) < HEADER_LENGTH:
        raise BlobError(f"{len(data)} bytes are too short for a blob")
    if not data.startswith(MAGIC):
        raise BlobError(f"it begins with {data[: len(MAGIC)]!r}, not {MAGIC!r}")
    if data[MAJOR_AT] != MAJOR:
        raise BlobError(f"its layout has major version {data[MAJOR_AT]}, but only {MAJOR} is known")
    length = int.from_bytes(data[LENGTH_AT : LENGTH_AT + 2], "little")
    if not LENGTH <= length <= MAX_LENGTH:
        raise BlobError(f"its length field is {length}, but {LENGTH} to {MAX_LENGTH} are allowed")
    if length != len(data):
        raise BlobError(f"its length field is {length}, but it has {len(data)} bytes")
    (checksum,) = CHECKSUM.unpack_from(data, length - CHECKSUM.size)
    if checksum != zlib.crc32(data[: length - CHECKSUM.size]):
        raise BlobError("its checksum does not match: it is damaged")


def _slope(data: bytes, temperature_c: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return b_a(T) and its range; NO_SLOPE and NO_RANGE if they are missing or unusable."""
    if len(data) < LENGTH_WITH_SLOPE:
        return NO_SLOPE, NO_RANGE
    values = SLOPE.unpack_from(data, FIELDS.size)
    usable = all(map(math.isfinite, (*values, temperature_c))) and values[3] <= temperature_c <= values[4]
    return (values[:3], values[3:]) if usable else (NO_SLOPE, NO_RANGE)


def _gyro_counts(data: bytes) -> float | None:
    if len(data) < LENGTH_WITH_COUNTS:
        return None
    (counts,) = COUNTS.unpack_from(data, LENGTH_WITH_SLOPE - CHECKSUM.size)
    return float(counts)


def _check_usable(blob: Blob) -> None:
    for name, count in (*LAYOUT, *APPENDED):
        if count == 1:
            continue
        values = getattr(blob, name)
        if len(values) != count:
            raise BlobError(f"{name} has {len(values)} numbers, not {count}")
        if name in ("D", "b_a", "applied_b_a") and not all(map(math.isfinite, values)):
            raise BlobError(f"{name} holds a number that is not finite")
    _check_invertible(blob.D)
    for name in ("accel_range_g", "gyro_range_dps"):
        if not 0.0 <= getattr(blob, name) < math.inf:
            raise BlobError(f"{name} is {getattr(blob, name)}, which is neither a range nor 0")
    if blob.gyro_counts is not None and not 0.0 < blob.gyro_counts < math.inf:
        raise BlobError(f"gyro_counts is {blob.gyro_counts}, which is not a number of counts")


def _check_invertible(D: tuple[float, ...]) -> None:
    a, b, c, d, e, f, g, h, i = D
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    most = max(map(abs, D))
    if not LEAST_GAIN <= most <= MOST_GAIN or not abs(determinant) > LEAST_DETERMINANT * most**3:
        raise BlobError("D has no inverse")


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
