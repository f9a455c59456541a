"""Serial faults of the table at given bytes of an emulated line."""

from __future__ import annotations

from collections.abc import Iterable

from mpucal.simulated.faults import FAULTS

LATE = "late"


class LineFaults:
    """Function that damages the bytes of an EmulatedLine.

    Parameters
    ----------
    at : number of the byte on the line, name of the fault, and a number from 1 to 255 that varies the damage.

    Attributes
    ----------
    number : of the next byte.
    """

    def __init__(self, at: Iterable[tuple[int, str, int]]) -> None:
        self._at = {number: (name, value) for number, name, value in at}
        self.number = 0
        self._held = b""

    def __call__(self, data: bytes) -> bytes:
        """Return the bytes that arrive now; late ones arrive with the next."""
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
