"""Diagnosis of a serial port on which no bridge answers, by the bytes that come from it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from ..errors import BusError
from .link_errors import flooded
from .port_errors import other_ports

KEPT_BYTES = 400
WORDS = 40
# Text at the right rate is all printable; at a wrong rate hardly more than a third of the bytes are.
PRINTABLE = 0.9
# MicroPython's replies to a HELLO, some bytes of which enter its raw REPL.
REPLS = (b"raw REPL; CTRL-B", b"MicroPython v", b">>> ")
CIRCUIT = b"CircuitPython"


class PortDiagnosis:
    """Collector of the bytes that came instead of a bridge's reply.

    Attributes
    ----------
    floods : number of times that more came than any bridge sends.
    """

    def __init__(self) -> None:
        self.floods = 0
        self._bytes: defaultdict[int, bytearray] = defaultdict(bytearray)

    def add(self, data: bytes, baud: int) -> None:
        """Add bytes received at `baud`."""
        kept = self._bytes[baud]
        kept += data[: KEPT_BYTES - len(kept)]

    @property
    def is_repl(self) -> bool:
        """True if the bytes come from MicroPython or CircuitPython."""
        return self._contains(*REPLS)

    def error(self, port: str, bauds: Sequence[int]) -> BusError:
        """Return the error for a port without a bridge."""
        if not self._bytes:
            return BusError(
                f"nothing answers on {port}",
                f"check that the board there runs the bridge's firmware (mpucal/firmware), or {other_ports()}",
            )
        if self.floods:
            return BusError(*flooded(port))
        if self._contains(CIRCUIT):
            return BusError(
                f"CircuitPython answers on {port}, not a bridge",
                "put MicroPython or the bridge's firmware (mpucal/firmware) on the board: CircuitPython's console "
                "interprets every byte 3 as Ctrl-C",
            )
        if self.is_repl:
            return BusError(
                f"MicroPython answers on {port}, not a bridge",
                "add --micropython, or --micropython=SDA,SCL with the chip's pins, and mpucal runs the bridge there",
            )
        text = max(map(_text, self._bytes.values()), key=len)
        if text:
            return BusError(
                f"the device on {port} is not a bridge: it sends {text!r}",
                f"put the bridge's firmware on it (mpucal/firmware), or {other_ports()}",
            )
        rates = " or ".join(str(baud) for baud in bauds)
        return BusError(
            f"{port} sends bytes, but not those of a bridge at {rates} baud",
            f"give the rate of its firmware behind a colon, as in {port}:57600, or {other_ports()}",
        )

    def _contains(self, *words: bytes) -> bool:
        return any(word in kept for kept in self._bytes.values() for word in words)


def _text(data: bytearray) -> str:
    """Return the longest line of `data` if it is text, else an empty string."""
    printable = sum(byte in b"\t\r\n" or 0x20 <= byte < 0x7F for byte in data)
    if printable < PRINTABLE * len(data):
        return ""
    return max((line.strip() for line in data.decode("ascii", "replace").splitlines()), key=len, default="")[:WORDS]
