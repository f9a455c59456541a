"""Address of the page, and its QR code."""

from __future__ import annotations

from io import StringIO
from typing import NamedTuple

LOOPBACK, LAN = "127.0.0.1", "lan"
_ALL_INTERFACES = ("0.0.0.0", "::")


class Address(NamedTuple):
    """Address to listen on, and the host's name in the page's address.

    Attributes
    ----------
    host, port : to listen on; port 0: any free one. name : of the host, as browsers reach it.
    """

    host: str = LOOPBACK
    port: int = 0
    name: str = LOOPBACK


def parse_address(text: str) -> Address:
    """Parse `lan` or HOST:PORT; ValueError if it is neither."""
    if text == LOOPBACK:
        return Address()
    if text == LAN:
        return Address(lan_host(), 0, lan_host())
    host, colon, port = text.rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    if not colon or not host or not port.isascii() or not port.isdigit() or int(port) > 0xFFFF:
        raise ValueError(f"{text!r} is not an address for a page: give lan, or HOST:PORT as in 192.168.1.20:8000.")
    name = lan_host() if host in _ALL_INTERFACES else host
    return Address(host, int(port), f"[{name}]" if ":" in name else name)


def lan_host() -> str:
    """Return this computer's address in its network; the loopback address if it is in none."""
    import socket  # noqa: PLC0415 - only a page needs it

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            # An address for documentation (RFC 5737): the socket chooses its interface for it, and sends nothing.
            probe.connect(("192.0.2.1", 9))
        except OSError:
            return LOOPBACK
        return str(probe.getsockname()[0])


def qr_code(url: str) -> str:
    """Return the QR code of a URL as half blocks of text, light on dark, two modules a line."""
    import segno  # noqa: PLC0415 - only a page needs it

    out = StringIO()
    segno.make(url, error="l", micro=False).terminal(out, compact=True, border=2)
    return out.getvalue()
