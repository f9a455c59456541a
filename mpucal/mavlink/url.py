"""Where a vehicle is, in a URL's words: udp:14550, tcp:HOST:PORT, a serial device."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from ..errors import UsageError

FORMS = "udp:PORT, udp:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT, or a serial device such as /dev/ttyACM0:115200"
EVERYWHERE = "0.0.0.0"
USB_BAUD = 115200  # what a USB port ignores, and a telemetry port of neither autopilot uses
PORTS = range(1, 65536)


class Kind(StrEnum):
    """How the bytes move."""

    UDP = "udp"
    UDPOUT = "udpout"
    TCP = "tcp"
    SERIAL = "serial"


@dataclass(frozen=True)
class Url:
    """A parsed URL.

    Attributes
    ----------
    kind : how the bytes move. host : whom to ask, or (UDP) which of our addresses listens; a serial device's path.
    port : UDP's or TCP's port, or a serial device's baud.
    """

    kind: Kind
    host: str
    port: int

    def __str__(self) -> str:
        return f"{self.host}:{self.port}" if self.kind is Kind.SERIAL else f"{self.kind}:{self.host}:{self.port}"


def parse_url(text: str) -> Url:
    """The words of --mavlink.

    Raises
    ------
    UsageError : none of FORMS.
    """
    head, _, rest = text.partition(":")
    if head in (Kind.UDP, Kind.UDPOUT, Kind.TCP):
        host, _, port = rest.rpartition(":")
        if rest and not host and not rest.isdecimal():
            raise _wrong(text, "it names no port")
        if not host and head == Kind.UDP:
            host = EVERYWHERE
        return Url(Kind(head), _host(host, text), _port(port, text))
    if text.startswith(("/", "serial:")):
        device, _, baud = text.removeprefix("serial:").partition(":")
        if not baud:
            return Url(Kind.SERIAL, _host(device, text), USB_BAUD)
        if not baud.isdecimal() or not int(baud):
            raise _wrong(text, f"{baud!r} is no baud rate")
        return Url(Kind.SERIAL, _host(device, text), int(baud))
    raise _wrong(text, "no known form")


def _host(host: str, text: str) -> str:
    if not host:
        raise _wrong(text, "it names no host")
    return host


def _port(port: str, text: str) -> int:
    if not (port.isascii() and port.isdecimal() and int(port) in PORTS):
        raise _wrong(text, f"{port!r} is no port")
    return int(port)


def _wrong(text: str, why: str) -> UsageError:
    return UsageError(f"--mavlink {text} cannot be understood ({why})", f"give {FORMS}")
