"""URLs of vehicles: udp:14550, tcp:HOST:PORT, a serial device."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from ..errors import UsageError

FORMS = "udp:PORT, udp:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT, or a serial device such as /dev/ttyACM0:115200"
EVERYWHERE = "0.0.0.0"
USB_BAUD = 115200  # USB ports ignore it; neither autopilot has it as the default of a telemetry port.
PORTS = range(1, 65536)


class Kind(StrEnum):
    """Kinds of transport."""

    UDP = "udp"
    UDPOUT = "udpout"
    TCP = "tcp"
    SERIAL = "serial"


@dataclass(frozen=True)
class Url:
    """A parsed URL.

    Attributes
    ----------
    kind : of transport. host : the partner, our listening address (UDP), or the path of a serial device.
    port : of UDP or TCP; the baud rate of a serial device.
    """

    kind: Kind
    host: str
    port: int

    def __str__(self) -> str:
        return f"{self.host}:{self.port}" if self.kind is Kind.SERIAL else f"{self.kind}:{self.host}:{self.port}"


def parse_url(text: str) -> Url:
    """Parse the value of --mavlink.

    Raises
    ------
    UsageError : it has none of FORMS.
    """
    head, _, rest = text.partition(":")
    if head in (Kind.UDP, Kind.UDPOUT, Kind.TCP):
        host, _, port = rest.rpartition(":")
        if rest and not host and not rest.isdecimal():
            raise _not_understood(text, "it names no port")
        if not host and head == Kind.UDP:
            host = EVERYWHERE
        if not (port.isascii() and port.isdecimal() and int(port) in PORTS):
            raise _not_understood(text, f"{port!r} is not a port" if host else "it names no host")
        return _url(Kind(head), host, int(port), text)
    if text.startswith(("/", "serial:")):
        device, _, baud = text.removeprefix("serial:").partition(":")
        if baud and not (baud.isdecimal() and int(baud)):
            raise _not_understood(text, f"{baud!r} is not a baud rate")
        return _url(Kind.SERIAL, device, int(baud) if baud else USB_BAUD, text)
    raise _not_understood(text, "no known form")


def _url(kind: Kind, host: str, port: int, text: str) -> Url:
    if not host:
        raise _not_understood(text, "it names no host")
    return Url(kind, host, port)


def _not_understood(text: str, why: str) -> UsageError:
    return UsageError(f"--mavlink {text} cannot be understood ({why})", f"give {FORMS}")
