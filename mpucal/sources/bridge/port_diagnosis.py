"""What is heard on a port while nobody answers HELLO, and what that means."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from ...errors import BusError
from .link_errors import flooded
from .port_errors import another

KEPT_BYTES = 400
WORDS = 40
# Text at the right rate is all printable; at a wrong one hardly more than a third of all bytes are.
PRINTABLE = 0.9
# what MicroPython says to the bytes of a HELLO, among which are those that enter its raw REPL
REPLS = (b"raw REPL; CTRL-B", b"MicroPython v", b">>> ")
CIRCUIT = b"CircuitPython"


class PortDiagnosis:
    """The bytes that came instead of a bridge's reply.

    Attributes
    ----------
    floods : how often they were more than any bridge sends.
    """

    def __init__(self) -> None:
        self.floods = 0
        self._bytes: defaultdict[int, bytearray] = defaultdict(bytearray)

    def take(self, data: bytes, baud: int) -> None:
        """More of them, at `baud`."""
        kept = self._bytes[baud]
        kept += data[: KEPT_BYTES - len(kept)]

    @property
    def is_repl(self) -> bool:
        """Whether MicroPython said them, or CircuitPython."""
        return self._holds(*REPLS)

    def why_nobody(self, port: str, bauds: Sequence[int]) -> BusError:
        """The sentence for a port without a bridge."""
        if not self._bytes:
            return BusError(
                f"nothing answers on {port}",
                f"check that the board there runs the bridge's firmware (mpucal/firmware), or {another()}",
            )
        if self.floods:
            return BusError(*flooded(port))
        if self._holds(CIRCUIT):
            return BusError(
                f"CircuitPython answers on {port}, and no bridge",
                "put MicroPython on the board, or the bridge's firmware (mpucal/firmware): CircuitPython takes every "
                "byte 3 on its console for Ctrl-C",
            )
        if self.is_repl:
            return BusError(
                f"MicroPython answers on {port}, and no bridge",
                "add --micropython, or --micropython=SDA,SCL with the chip's pins, and mpucal runs the bridge there",
            )
        text = max(map(_text, self._bytes.values()), key=len)
        if text:
            return BusError(
                f"what is on {port} is no bridge: it says {text!r}",
                f"put the bridge's firmware on it (mpucal/firmware), or {another()}",
            )
        rates = " or ".join(str(baud) for baud in bauds)
        return BusError(
            f"bytes come from {port}, but none that a bridge sends at {rates} baud",
            f"give the rate of its firmware behind a colon, as in {port}:57600, or {another()}",
        )

    def _holds(self, *words: bytes) -> bool:
        return any(word in kept for kept in self._bytes.values() for word in words)


def _text(data: bytearray) -> str:
    """The longest line of `data`, if it is text."""
    printable = sum(byte in b"\t\r\n" or 0x20 <= byte < 0x7F for byte in data)
    if printable < PRINTABLE * len(data):
        return ""
    return max((line.strip() for line in data.decode("ascii", "replace").splitlines()), key=len, default="")[:WORDS]
