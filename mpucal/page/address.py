"""Where the page is served, and how that is shown to who opens it: as an address and as a QR code."""

from __future__ import annotations

import socket
from dataclasses import dataclass
from io import StringIO

HERE, LAN = "127.0.0.1", "lan"
_EVERYWHERE = ("0.0.0.0", "::")
# an address of documentation (RFC 5737): a datagram socket picks the interface, and nothing is sent
_SOMEWHERE = ("192.0.2.1", 9)


@dataclass(frozen=True)
class Address:
    """Where to listen, and the name under which that is reached.

    Attributes
    ----------
    host, port : to listen on; port 0: any that is free. name : of the host in the page's address.
    """

    host: str = HERE
    port: int = 0
    name: str = HERE


def address(text: str) -> Address:
    """`lan`, or HOST:PORT; ValueError with a sentence where that is neither."""
    if text == HERE:
        return Address()
    if text == LAN:
        return Address(lan_host(), 0, lan_host())
    host, colon, port = text.rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    if not colon or not host or not port.isascii() or not port.isdigit() or int(port) > 0xFFFF:
        raise ValueError(f"{text!r} is no address for a page: give lan, or HOST:PORT as in 192.168.1.20:8000.")
    name = lan_host() if host in _EVERYWHERE else host
    return Address(host, int(port), f"[{name}]" if ":" in name else name)


def lan_host() -> str:
    """This computer's address in its network; the loopback's where it is in none."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(_SOMEWHERE)
        except OSError:
            return HERE
        return str(probe.getsockname()[0])


def qr_code(url: str) -> str:
    """The address in half blocks of text, light on dark, two modules a line."""
    import segno  # noqa: PLC0415 - only a page needs it

    out = StringIO()
    segno.make(url, error="l", micro=False).terminal(out, compact=True, border=2)
    return out.getvalue()
