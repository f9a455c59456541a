"""Protocol Buffers' wire format, as far as a capture needs it: arrays from packed integers, and back.

A field is a key, `number << 3 | wire type`, and a varint (type 0) or a length and as many bytes (type 2). A varint has
seven bits per byte, the lowest first; the eighth bit is set in all bytes but the last. Signed integers (sint) are
zigzag: 0, -1, 1, -2. `packed.cpp` packs and unpacks them.

Source: https://protobuf.dev/programming-guides/encoding, and descriptor.proto for the schema.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._packed import frames, packed, unpacked

Columns = NDArray[np.uint64]

VARINT, BYTES = 0, 2
__all__ = ["field", "fields", "frames", "pack_varints", "schema", "steps", "unpacked", "unzigzag", "zigzag"]

# descriptor.proto: types and labels of fields
TYPES = {"uint64": 4, "string": 9, "message": 11, "bytes": 12, "uint32": 13, "sint32": 17, "sint64": 18}
OPTIONAL, REPEATED = 1, 3


def field(number: int, value: int | bytes) -> bytes:
    """Encode a field of a whole number >= 0, or of bytes."""
    if isinstance(value, int):
        return pack_varints([number << 3 | VARINT, value])
    return pack_varints([number << 3 | BYTES, len(value)]) + value


def fields(message: bytes) -> Iterator[tuple[int, int | bytes]]:
    """Yield number and value of each field, in order.

    Raises
    ------
    ValueError : it is not a message, or has a field of another wire type.
    """
    at = 0
    while at < len(message):
        key, at = _read(message, at)
        value, at = _read(message, at)
        if key & 7 == VARINT:
            yield key >> 3, value
        elif key & 7 == BYTES and at + value <= len(message):
            yield key >> 3, message[at : at + value]
            at += value
        else:
            raise ValueError(f"a field of wire type {key & 7} at byte {at}")


def pack_varints(values: ArrayLike) -> bytes:
    """Encode (n,) whole numbers >= 0 as consecutive varints."""
    return packed(np.ascontiguousarray(values, np.uint64))


def steps(values: NDArray[Any]) -> Columns:
    """Return the zigzag numbers (n,) of the steps from one of (n,) numbers to the next, from 0 to the first."""
    step = values.copy()
    step[1:] -= values[:-1]
    return zigzag(step.ravel())


def zigzag(values: ArrayLike) -> Columns:
    """Return (n,) signed numbers as unsigned ones that are small for small magnitudes."""
    value = np.asarray(values, np.int64)
    return ((value << 1) ^ (value >> 63)).view(np.uint64)


def unzigzag(values: Columns) -> NDArray[np.int64]:
    """Invert zigzag, for (n,) numbers."""
    return (values >> np.uint64(1)).view(np.int64) ^ -(values & np.uint64(1)).view(np.int64)


def schema(package: str, messages: Mapping[str, Sequence[tuple[str, str, bool]]]) -> bytes:
    """Return a FileDescriptorSet of messages, whose fields (name, type, repeated) are numbered from 1.

    A type is one of TYPES, or the name of a message.
    """
    file = field(1, f"{package}.proto".encode()) + field(2, package.encode())
    for name, columns in messages.items():
        message = field(1, name.encode())
        for number, (column, kind, repeated) in enumerate(columns, 1):
            what = field(1, column.encode()) + field(3, number) + field(4, REPEATED if repeated else OPTIONAL)
            what += field(5, TYPES.get(kind, TYPES["message"]))
            message += field(2, what if kind in TYPES else what + field(6, f".{package}.{kind}".encode()))
        file += field(4, message)
    return field(1, file + field(12, b"proto3"))


def _read(message: bytes, at: int) -> tuple[int, int]:
    """Return a varint, of ten bytes at most, and the offset of its end."""
    value = 0
    for place in range(10):
        if at + place >= len(message):
            break
        digit = message[at + place]
        value |= (digit & 127) << 7 * place
        if digit < 128:
            return value, at + place + 1
    raise ValueError("a number is cut")
