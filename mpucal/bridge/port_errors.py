"""Errors of a serial port and of the bridge on it as sentences, and the diagnosis of a port without a bridge."""

from __future__ import annotations

import errno
import re
from collections import defaultdict
from collections.abc import Sequence

from ..errors import BusError, LinkError
from ..sources.host_bus import WIRES, device_error
from .messages import Status

AUTOPILOT = re.compile("ardupilot|px4", re.IGNORECASE)

# Text at the right rate is all printable; at a wrong rate hardly more than a third of the bytes are.
PRINTABLE = 0.9
# MicroPython's replies to a HELLO, some bytes of which enter its raw REPL.
REPLS = (b"raw REPL; CTRL-B", b"MicroPython v", b">>> ")
CIRCUIT = b"CircuitPython"

# What happened and the remedy, by the status of a failed request; {port} stands for the name of the port.
SENTENCES: dict[int, tuple[str, str]] = {
    Status.UNKNOWN_TYPE: ("the bridge on {port} does not know this request", "put a newer firmware on it"),
    Status.BAD_PAYLOAD: ("the bridge on {port} refuses a request's values", "put a firmware of this version on it"),
    Status.NO_ANSWER: ("the chip no longer answers the bridge on {port}", WIRES),
    Status.BUS_FAILED: (
        "a transfer on the I2C bus of the bridge on {port} broke off",
        "shorten the wires, or add pull-ups",
    ),
    Status.NO_BLOB: (
        "the bridge on {port} stores no calibration",
        "store one: mpucal write CALIBRATION bridge --serial {port}",
    ),
    Status.BAD_BLOB: ("the bridge on {port} received a calibration that is not valid", "try again"),
    Status.BAD_OFFSET: ("the bridge on {port} missed a part of the calibration", "try again"),
    Status.NO_ROOM: ("the memory of the bridge on {port} is too small for the calibration", "use another board"),
    Status.NOT_BEGUN: ("the bridge on {port} was reset while it received the calibration", "try again"),
    Status.OCCUPIED: (
        "the memory of the bridge on {port} holds other data",
        "choose another place with MPUCAL_EEPROM_AT in the sketch, or overwrite it:"
        " mpucal write CALIBRATION bridge --serial {port}",
    ),
    Status.STORAGE_FAILED: ("the memory of the bridge on {port} does not keep what is written", "use another board"),
}


def request_failed(port: str, status: int) -> tuple[str, str]:
    """Describe a request that failed with `status`."""
    unknown = f"the bridge on {{port}} answers with status {status}", "put a newer mpucal on this machine"
    what, remedy = SENTENCES.get(status, unknown)
    return what.format(port=port), remedy.format(port=port)


def opening_error(error: Exception, port: str) -> BusError:
    """Convert the error of a port that did not open."""
    number = getattr(error, "errno", None)
    if number in (errno.ENOENT, errno.EACCES, errno.EPERM) and isinstance(error, OSError):
        return device_error(error, port, "a serial port", "dialout", other_ports())
    if number in (errno.EBUSY, errno.EAGAIN):
        return BusError(f"another program uses {port}", "close it (a serial monitor, perhaps), then try again")
    if "://" in port:
        what, remedy = f"cannot connect to {port}", "check the address, and that a server runs there"
    else:
        odd = number in (None, errno.ENOTTY, errno.EINVAL, errno.EISDIR)
        what, remedy = f"{port} is not a serial port" if odd else f"cannot open {port}", other_ports()
    return BusError(f"{what} ({_reason(error)})", remedy)


def port_gone(port: str) -> LinkError:
    """Return the error of a port that was there and is not any more."""
    return LinkError(f"{port} is gone", "check its cable, plug it in again, then start again")


def ports() -> list[tuple[str, str]]:
    """List the serial ports with a device behind them: (name, description)."""
    from serial.tools.list_ports import comports  # noqa: PLC0415 - only needed for an error

    return [(port.device, port.description) for port in sorted(comports()) if port.hwid != "n/a"]


def boards() -> list[tuple[str, str]]:
    """List the ports but those of autopilots."""
    return [port for port in ports() if not AUTOPILOT.search(port[1])]


def autopilots() -> list[tuple[str, str]]:
    """List the ports whose USB description names an autopilot's firmware."""
    return [port for port in ports() if AUTOPILOT.search(port[1])]


def other_ports() -> str:
    """Return the remedy for a missing or wrong port: the ports that there are."""
    there = [f"{port} ({what})" for port, what in ports()]
    return f"use one of {', '.join(there)}" if there else "connect the bridge (no serial ports found)"


def _reason(error: Exception) -> str:
    """Return the system's message, which pyserial wraps in its own."""
    found = re.findall(r"\[Errno \d+\] ([^:']+)|\(\d+, '([^']+)'\)", str(error))
    return "".join(found[-1]) if found else str(error)


def no_reply(port: str) -> tuple[str, str]:
    """Describe a bridge that does not reply."""
    return f"the bridge on {port} no longer answers", "check its cable and supply, then start again"


def flooded(port: str) -> tuple[str, str]:
    """Describe a port with more bytes than any bridge sends, and no answer among them."""
    return (
        f"{port} is flooded: far more bytes come than a bridge sends, and no answer among them",
        "check that the bridge, and nothing else, is on that port, and plug it in again",
    )


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
        """Add bytes received at `baud`; the first 400 are kept."""
        kept = self._bytes[baud]
        kept += data[: 400 - len(kept)]

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
    """Return 40 letters of the longest line of `data` if it is text, else an empty string."""
    printable = sum(byte in b"\t\r\n" or 0x20 <= byte < 0x7F for byte in data)
    if printable < PRINTABLE * len(data):
        return ""
    return max((line.strip() for line in data.decode("ascii", "replace").splitlines()), key=len, default="")[:40]
