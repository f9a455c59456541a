"""Values of --mavlink and --signing-key: where a vehicle is, and the key of MAVLink 2 signing."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from ..arguments import read_limited
from ..errors import RecordingError, UsageError

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
        host = host or (EVERYWHERE if head == Kind.UDP else "")
        if not host:
            raise _not_understood(text, "it names no host")
        if not (port.isascii() and port.isdecimal() and int(port) in PORTS):
            raise _not_understood(text, f"{port!r} is not a port")
        return Url(Kind(head), host, int(port))
    if text.startswith(("/", "serial:")):
        device, _, baud = text.removeprefix("serial:").partition(":")
        if baud and not (baud.isdecimal() and int(baud)):
            raise _not_understood(text, f"{baud!r} is not a baud rate")
        if not device:
            raise _not_understood(text, "it names no device")
        return Url(Kind.SERIAL, device, int(baud) if baud else USB_BAUD)
    raise _not_understood(text, "no known form")


def _not_understood(text: str, why: str) -> UsageError:
    return UsageError(f"--mavlink {text} cannot be understood ({why})", f"give {FORMS}")


KEY_BYTES = 32
# No passphrase is longer.
MOST_BYTES = 4096
_HEXADECIMAL = re.compile(rb"\s*([0-9a-fA-F]{64})\s*")


def read_key(path: Path) -> bytes:
    """Return the key in a file: its 32 bytes, its 64 hexadecimal digits, or the SHA-256 of its passphrase.

    Ground stations hash passphrases in the same way. A file of 32 bytes is the key itself, unless it is a line of
    text with its end: a passphrase of 31 or 30 letters. White space around a passphrase is ignored.

    Raises
    ------
    UsageError : the file cannot be read, is a pipe or device, longer than MOST_BYTES, or empty.
    """
    try:
        held = read_limited(path, MOST_BYTES)
    except RecordingError as error:
        raise UsageError(f"the signing key cannot be read: {error.what}", "check --signing-key") from error
    if len(held) == KEY_BYTES and not _is_line(held):
        return held
    digits = _HEXADECIMAL.fullmatch(held)
    if digits:
        return bytes.fromhex(digits[1].decode())
    passphrase = held.strip()
    if not passphrase:
        raise UsageError(f"the signing key {path} is empty", "give 32 bytes, 64 hexadecimal digits, or a passphrase")
    return hashlib.sha256(passphrase).digest()


def _is_line(held: bytes) -> bool:
    try:
        text = held.decode()
    except UnicodeDecodeError:
        return False
    return text.endswith("\n") and text.removesuffix("\n").removesuffix("\r").isprintable()
