"""Parameters as they travel in PARAM_VALUE and PARAM_SET, and in the files of ground stations."""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...arguments import reading
from ...errors import RecordingError
from ..dialect import HEADER, Message
from ..firmwares import PX4

Number = int | float

FLOAT32 = struct.Struct("<f")

# MAV_PARAM_TYPE -> PX4's layout of the value's bytes in the float's bytes
BYTEWISE = {
    1: struct.Struct("<Bxxx"),
    2: struct.Struct("<bxxx"),
    3: struct.Struct("<Hxx"),
    4: struct.Struct("<hxx"),
    5: struct.Struct("<I"),
    6: struct.Struct("<i"),
}
INT32, REAL32 = 6, 9

# MAV_PARAM_ERROR; pymavlink's enumeration lacks the end.
ERRORS = {
    1: "it does not exist",
    2: "the value is out of range",
    3: "permission denied",
    4: "no such component",
    5: "it is read-only",
    6: "its type is not supported",
    7: "it has another type",
    8: "it cannot be read",
}


@dataclass(frozen=True)
class Parameter:
    """A parameter as a vehicle holds it.

    Attributes
    ----------
    name : up to 16 characters. value : a float exactly as a float32 holds it, or a whole number.
    type : MAV_PARAM_TYPE, which PX4 wants back exactly.
    """

    name: str
    value: Number
    type: int = REAL32


def as_float32(value: float) -> float:
    """Return the float32 nearest to `value`, which a vehicle can hold and echo."""
    return float(np.float32(value))


def to_wire(value: Number, kind: int, bytewise: bool) -> float:
    """Return the float that carries `value` of MAV_PARAM_TYPE `kind`.

    Parameters
    ----------
    bytewise : PX4 sends the bytes of an integer; otherwise its value is sent (ArduPilot).
    """
    if bytewise and kind in BYTEWISE:
        return float(FLOAT32.unpack(BYTEWISE[kind].pack(int(value)))[0])
    return as_float32(value)


def from_wire(message: Message, bytewise: bool) -> Parameter:
    """Return the parameter in a PARAM_VALUE or PARAM_SET."""
    kind = int(message.param_type)
    value: Number = float(message.param_value)
    if kind in BYTEWISE and bytewise:
        value = BYTEWISE[kind].unpack(_wire_bytes(message))[0]
    elif kind in BYTEWISE and math.isfinite(value):
        value = round(value)
    return Parameter(str(message.param_id), value, kind)


def _wire_bytes(message: Message) -> bytes:
    """Return the bytes of param_value, the payload's first field; as a float of Python a NaN may lose its bits."""
    packet = bytes(message.get_msgbuf())
    at = HEADER[packet[0]]
    # MAVLink 2 omits the zeros at the payload's end.
    return packet[at : at + min(packet[1], FLOAT32.size)].ljust(FLOAT32.size, b"\0")


def decode_parameter(message: Message, bytewise: bool) -> Parameter | None:
    """Return the parameter in a PARAM_VALUE, None for another message or a value that is not finite."""
    if message.get_type() != "PARAM_VALUE":
        return None
    parameter = from_wire(message, bytewise)
    return parameter if math.isfinite(parameter.value) else None


def name_bytes(name: str) -> bytes:
    """Return a param_id: up to 16 bytes, without a NUL if the name fills them."""
    return name.encode("ascii")[:16]


def parameters_text(
    firmware: str,
    values: Mapping[str, float],
    remarks: Iterable[str] = (),
    system: int = 1,
    whole: Collection[str] = (),
) -> str:
    """Return a ground station's file, .param of ArduPilot or .params of PX4; `whole` are names of whole numbers.

    Floats have the nine digits that identify a float32.
    """
    if firmware == PX4:
        lines = ["#", "# Vehicle-Id Component-Id Name Value Type"]
        for name, value in values.items():
            lines.append(f"{system}\t1\t{name}\t{_digits(value)}\t{INT32 if name in whole else REAL32}")
    else:
        lines = [f"{name},{_digits(value)}" for name, value in values.items()]
    return "\n".join([*(f"# {remark}" for remark in remarks), *lines]) + "\n"


def read_parameters_file(path: Path) -> dict[str, float]:
    """Return the values in either kind of file, by name.

    Raises
    ------
    RecordingError : it cannot be read, or is neither.
    """
    try:
        with reading(path):
            lines = path.read_text(encoding="utf-8").splitlines()
        rows = [re.split(r"[\s,]+", line.strip()) for line in lines if line.strip() and not line.startswith("#")]
        # QGroundControl's rows have vehicle and component before, and the type after.
        pairs = [row[2:4] or row for row in rows]
        return {name: as_float32(float(value)) for name, value in pairs}
    except ValueError as error:
        raise RecordingError(f"{path} is not a parameter file ({error})", "give a .param or .params file") from error


def _digits(value: float) -> str:
    return f"{as_float32(value):.9g}"
