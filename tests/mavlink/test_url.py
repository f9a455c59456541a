"""Forms of --mavlink and of the key for signed packets."""

import hashlib
import os

import pytest

from mpucal.errors import UsageError
from mpucal.mavlink.url import Kind, Url, parse_url, read_key

KEY = bytes(range(32))


@pytest.mark.parametrize(
    ("text", "url"),
    [
        ("udp:14550", Url(Kind.UDP, "0.0.0.0", 14550)),
        ("udpout:192.168.4.1:14555", Url(Kind.UDPOUT, "192.168.4.1", 14555)),
        ("tcp:localhost:5760", Url(Kind.TCP, "localhost", 5760)),
        ("/dev/ttyACM0", Url(Kind.SERIAL, "/dev/ttyACM0", 115200)),
        ("serial:/dev/serial0:921600", Url(Kind.SERIAL, "/dev/serial0", 921600)),
    ],
)
def test_the_forms_of_a_url(text, url):
    assert parse_url(text) == url


WRONG = "udp: udp:0 udp:65536 udp:² tcp:h: /dev/ttyX:fast 14550 serial: http:x:80"


@pytest.mark.parametrize("text", ["", *WRONG.split()])
def test_anything_else_is_refused_with_the_forms(text):
    with pytest.raises(UsageError, match="give udp:PORT, udp:HOST:PORT"):
        parse_url(text)


@pytest.mark.parametrize(("text", "lacking"), [("tcp:127.0.0.1", "port"), ("udp:pi", "port"), ("tcp:5760", "host")])
def test_the_missing_part_is_named(text, lacking):
    with pytest.raises(UsageError, match=f"it names no {lacking}"):
        parse_url(text)


@pytest.mark.parametrize(
    ("content", "key"),
    [
        pytest.param(KEY, KEY, id="bytes"),
        pytest.param(KEY.hex().encode() + b"\n", KEY, id="hexadecimal"),
        pytest.param(b"p" * 31 + b"\n", hashlib.sha256(b"p" * 31).digest(), id="a line of 32 bytes"),
        pytest.param(b"p" * 30 + b"\r\n", hashlib.sha256(b"p" * 30).digest(), id="another one"),
        pytest.param(b"p" * 32, b"p" * 32, id="32 letters"),
        pytest.param(b"\xff" * 31 + b"\n", b"\xff" * 31 + b"\n", id="no text, 10"),
    ],
)
def test_the_forms_of_a_key(content, key, tmp_path):
    (tmp_path / "key").write_bytes(content)
    assert read_key(tmp_path / "key") == key


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_and_a_long_or_empty_file_are_no_key(tmp_path):
    path = tmp_path / "key"
    os.mkfifo(path)
    with pytest.raises(UsageError, match="a pipe or device"):
        read_key(path)
    path.unlink()
    for content, what in ((b"p" * 5000, "longer than 4096 bytes"), (b" \n", "is empty")):
        path.write_bytes(content)
        with pytest.raises(UsageError, match=what):
            read_key(path)
