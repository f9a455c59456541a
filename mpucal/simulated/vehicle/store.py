"""Store of a simulated vehicle: its parameters in their order, and the files of its card."""

from __future__ import annotations

from collections import UserDict
from collections.abc import Iterable, Sequence

import numpy as np

from ...data import Vector
from ...mavlink.ftp import MOST_DATA, SEQUENCE, ErrorCode, Opcode, Payload
from ...mavlink.parameters.encoding import REAL32, Number, Parameter, as_float32

INT8, INT16 = 2, 4


class ParameterStore(UserDict[str, Number]):
    """Values by name, with types; floats are kept as float32."""

    def __init__(self) -> None:
        super().__init__()
        self._types: dict[str, int] = {}

    def add(self, name: str, value: Number, kind: int = REAL32) -> None:
        """Add a parameter of the firmware, with its default."""
        self._types[name] = kind
        self[name] = value

    def add_all(self, names: Iterable[str], value: float) -> None:
        """Add several floats with one default."""
        for name in names:
            self.add(name, value)

    def __setitem__(self, name: str, value: Number) -> None:
        super().__setitem__(name, as_float32(value) if self._types[name] == REAL32 else round(value))

    def type(self, name: str) -> int:
        """Return the MAV_PARAM_TYPE."""
        return self._types[name]

    def vector(self, names: Sequence[str]) -> Vector:
        """Return the values of several parameters."""
        return np.array([float(self[name]) for name in names])

    def set_vector(self, names: Sequence[str], values: Vector) -> None:
        """Set several parameters."""
        self.update(dict(zip(names, values.tolist(), strict=True)))

    def parameter(self, name: str) -> Parameter:
        """Return a parameter as it is sent."""
        return Parameter(name, self[name], self._types[name], list(self).index(name), len(self))


class Card:
    """Files by path, with one session at a time.

    Parameters
    ----------
    folder : the only one in which files can be created; None: there is no card.
    """

    def __init__(self, folder: str | None) -> None:
        self.files: dict[str, bytes] = {}
        self._folder = folder
        self._open: str | None = None
        self._last: Payload | None = None

    def answer(self, asked: Payload) -> Payload:
        """Return the reply; a repeated request gets the same one."""
        sequence = (asked.sequence + 1) % SEQUENCE
        if self._last is not None and self._last.sequence == sequence:
            return self._last
        done = self._execute(asked)
        opcode, data = (Opcode.NAK, bytes([done])) if isinstance(done, ErrorCode) else (Opcode.ACK, done)
        self._last = Payload(sequence, asked.session, opcode, data, asked.offset, None, asked.opcode)
        return self._last

    def _execute(self, asked: Payload) -> bytes | ErrorCode:
        path = asked.data.decode("ascii", "replace")
        if asked.opcode in (Opcode.RESET, Opcode.TERMINATE):
            self._open = None
            return b""
        if asked.opcode == Opcode.CREATE:
            if self._folder is None or not path.startswith(self._folder):
                return ErrorCode.NOT_FOUND
            self.files[path], self._open = b"", path
            return b""
        if asked.opcode in (Opcode.OPEN_TO_READ, Opcode.REMOVE):
            return self._existing(path, asked.opcode)
        if asked.opcode in (Opcode.READ, Opcode.WRITE) and self._open is not None:
            return self._move(self._open, asked)
        return ErrorCode.FAIL

    def _existing(self, path: str, opcode: int) -> bytes | ErrorCode:
        if path not in self.files:
            return ErrorCode.NOT_FOUND
        if opcode == Opcode.REMOVE:
            del self.files[path]
            return b""
        self._open = path
        return len(self.files[path]).to_bytes(4, "little")

    def _move(self, path: str, asked: Payload) -> bytes | ErrorCode:
        held, at = self.files[path], asked.offset
        if asked.opcode == Opcode.WRITE:
            self.files[path] = held[:at].ljust(at, b"\0") + asked.data + held[at + len(asked.data) :]
            return b""
        part = held[at : at + min(asked.size or MOST_DATA, MOST_DATA)]
        return part or ErrorCode.END_OF_FILE
