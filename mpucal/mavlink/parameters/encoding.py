"""A parameter's value in PARAM_VALUE and PARAM_SET, which carry a float whatever the type is."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

import numpy as np

from ..dialect import HEADER, Message

Number = int | float

FLOAT32 = struct.Struct("<f")
NAME_BYTES = 16

# MAV_PARAM_TYPE -> how PX4 lays the value's bytes into the float's
BYTEWISE = {
    1: struct.Struct("<Bxxx"),
    2: struct.Struct("<bxxx"),
    3: struct.Struct("<Hxx"),
    4: struct.Struct("<hxx"),
    5: struct.Struct("<I"),
    6: struct.Struct("<i"),
}
INT32, REAL32 = 6, 9

# MAV_PARAM_ERROR, of which pymavlink's enumeration lacks the end
ERRORS = {
    1: "it does not exist",
    2: "the value is out of range",
    3: "permission denied",
    4: "no such component",
    5: "it is read-only",
    6: "its type is not supported",
    7: "its type is another",
    8: "it cannot be read",
}


@dataclass(frozen=True)
class Parameter:
    """One parameter as a vehicle holds it.

    Attributes
    ----------
    name : up to 16 characters. value : a float exactly as a float32 holds it, or a whole number.
    type : MAV_PARAM_TYPE, which PX4 wants back exactly. index, count : its place in the vehicle's list.
    """

    name: str
    value: Number
    type: int = REAL32
    index: int = -1
    count: int = 0


def as_float32(value: float) -> float:
    """The float32 nearest to `value`: what a vehicle can hold and echo."""
    return float(np.float32(value))


def to_wire(value: Number, kind: int, bytewise: bool) -> float:
    """The float that carries `value` of MAV_PARAM_TYPE `kind`.

    Parameters
    ----------
    bytewise : the bytes of an integer travel as they are (PX4); else its value does (ArduPilot).
    """
    if bytewise and kind in BYTEWISE:
        return float(FLOAT32.unpack(BYTEWISE[kind].pack(int(value)))[0])
    return as_float32(value)


def from_wire(message: Message, bytewise: bool) -> Parameter:
    """The parameter in a PARAM_VALUE or PARAM_SET."""
    kind = int(message.param_type)
    value: Number = float(message.param_value)
    if kind in BYTEWISE:
        value = BYTEWISE[kind].unpack(wire_bytes(message))[0] if bytewise else _whole(value)
    index, count = getattr(message, "param_index", -1), getattr(message, "param_count", 0)
    return Parameter(str(message.param_id), value, kind, int(index), int(count))


def wire_bytes(message: Message) -> bytes:
    """The four bytes of param_value, which is first in the payload; a float of Python's may lose a NaN's."""
    packet = bytes(message.get_msgbuf())
    at = HEADER[packet[0]]
    # MAVLink 2 leaves out the zeros at the payload's end
    return packet[at : at + min(packet[1], FLOAT32.size)].ljust(FLOAT32.size, b"\0")


def _whole(value: float) -> Number:
    return round(value) if math.isfinite(value) else value


def decode_parameter(message: Message, bytewise: bool) -> Parameter | None:
    """The parameter in a PARAM_VALUE; None of another message, and of a value that is not finite."""
    if message.get_type() != "PARAM_VALUE":
        return None
    parameter = from_wire(message, bytewise)
    return parameter if math.isfinite(parameter.value) else None


def name_bytes(name: str) -> bytes:
    """A param_id: 16 bytes, with no NUL where the name fills them."""
    return name.encode("ascii")[:NAME_BYTES]


def error_name(number: int) -> str:
    """What a PARAM_ERROR's MAV_PARAM_ERROR means, in words."""
    return ERRORS.get(number, f"error {number}")
