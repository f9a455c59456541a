"""Bytes on an emulated line that suffer the serial faults of the table, each at its place."""

from __future__ import annotations

from collections.abc import Iterable

from ..faults import FAULTS

LATE = "late"


class LineFaults:
    """What arrives of what is sent; to be given to EmulatedLine.

    Parameters
    ----------
    at : number of the byte on the line, name of the fault, and a number from 1 to 255 that varies it.

    Attributes
    ----------
    number : of the next byte.
    """

    def __init__(self, at: Iterable[tuple[int, str, int]]) -> None:
        self._at = {number: (name, value) for number, name, value in at}
        self.number = 0
        self._held = b""

    def __call__(self, data: bytes) -> bytes:
        """What arrives now; what is late comes with the next."""
        out, late = bytearray(self._held), False
        self._held = b""
        for byte in data:
            name, value = self._at.get(self.number, ("", 0))
            self.number += 1
            late = late or name == LATE
            spoils = FAULTS[name].spoils if name else None
            made = bytes([byte]) if spoils is None else spoils(byte, value)
            if late:
                self._held += made
            else:
                out += made
        return bytes(out)
