"""URLs of --mavlink."""

import pytest

from mpucal.errors import UsageError
from mpucal.mavlink.url import Kind, Url, parse_url


@pytest.mark.parametrize(
    ("text", "url"),
    [
        ("udp:14550", Url(Kind.UDP, "0.0.0.0", 14550)),
        ("udp:127.0.0.1:14550", Url(Kind.UDP, "127.0.0.1", 14550)),
        ("udpout:192.168.4.1:14555", Url(Kind.UDPOUT, "192.168.4.1", 14555)),
        ("tcp:localhost:5760", Url(Kind.TCP, "localhost", 5760)),
        ("/dev/ttyACM0", Url(Kind.SERIAL, "/dev/ttyACM0", 115200)),
        ("/dev/ttyUSB0:57600", Url(Kind.SERIAL, "/dev/ttyUSB0", 57600)),
        ("serial:/dev/serial0:921600", Url(Kind.SERIAL, "/dev/serial0", 921600)),
    ],
)
def test_the_forms(text, url):
    assert parse_url(text) == url


WRONG = """udp udp: udp:0 udp:65536 udp:x udp:² tcp:5760 udpout:1.2.3.4 tcp:h: /dev/ttyX:fast /dev/ttyX:0 14550
serial: http:x:80"""


@pytest.mark.parametrize("text", ["", *WRONG.split()])
def test_anything_else_is_refused_with_the_forms(text):
    with pytest.raises(UsageError, match="give udp:PORT, udp:HOST:PORT"):
        parse_url(text)


@pytest.mark.parametrize(("text", "lacking"), [("tcp:127.0.0.1", "port"), ("udp:pi", "port"), ("tcp:5760", "host")])
def test_the_missing_part_is_named(text, lacking):
    with pytest.raises(UsageError, match=f"it names no {lacking}"):
        parse_url(text)
