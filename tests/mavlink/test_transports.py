"""Real sockets on loopback, and a pseudo terminal."""

import os
import pty
import socket
import tty
from contextlib import closing
from dataclasses import replace
from types import SimpleNamespace

import pytest

from mpucal.errors import LinkError, NoAnswer
from mpucal.mavlink.transports import open_transport
from mpucal.mavlink.url import Kind, Url

SOON_NS = 60_000_000_000
AWAY_NS = 200_000_000
# An address of this process alone, so that tests beside it take none of its ports.
HOST = f"127.{os.getpid() >> 16 & 63 | 64}.{os.getpid() >> 8 & 255}.{os.getpid() & 255}"


@pytest.fixture
def other():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        line.bind((HOST, 0))
        line.settimeout(60)
        yield line


def free_udp():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        line.bind((HOST, 0))
        return line.getsockname()[1]


class Line:
    """A pseudo terminal: a serial line, and its other end."""

    def __init__(self):
        self.ours, self._theirs = pty.openpty()
        tty.setraw(self.ours)
        self.url = Url(Kind.SERIAL, os.ttyname(self._theirs), 57600)

    def close(self):
        os.close(self.ours)
        os.close(self._theirs)


def heard(line, transport):
    """Write to the line until something is received; return it."""
    for _ in range(SOON_NS // AWAY_NS):
        os.write(line.ours, b"hello")
        received = transport.receive(transport.now_ns() + AWAY_NS)
        if received is not None:
            return received
    raise AssertionError("nothing was heard")


def hears_nothing(transport):
    """Return True if nothing comes during four attempts to open it again."""
    return not any(transport.receive(transport.now_ns() + AWAY_NS) for _ in range(4))


def soon(transport):
    return transport.receive(transport.now_ns() + SOON_NS)


def test_udp_answers_the_sender_and_the_kernel_turns_strangers_away_once_the_vehicle_is_known(other):
    port = free_udp()
    with closing(open_transport(Url(Kind.UDP, HOST, port))) as transport:
        other.sendto(b"vehicle", (HOST, port))
        received = soon(transport)
        assert (received.data, received.t_ns % 1000) == (b"vehicle", 0)
        assert received.address == f"{HOST}:{other.getsockname()[1]}"
        transport.restrict(received.address)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            stranger.sendto(b"stranger", (HOST, port))
            other.sendto(b"again", (HOST, port))
            assert soon(transport).data == b"again"
            transport.send(b"answer", None)
            assert other.recv(99) == b"answer"
            transport.restrict(None)
            stranger.sendto(b"whoever", (HOST, port))
            assert soon(transport).data == b"whoever"


def test_tcp_moves_bytes_and_is_connected_again():
    server = socket.create_server((HOST, 0))
    where = server.getsockname()
    transport = open_transport(Url(Kind.TCP, *where))
    line, _ = server.accept()
    with closing(transport):
        line.sendall(b"hello")
        assert soon(transport).data == b"hello"
        transport.send(b"answer", "whoever")
        assert line.recv(99) == b"answer"
        line.close()
        server.close()
        assert hears_nothing(transport)
        transport.send(b"lost", None)
        with socket.create_server(where) as server:
            assert hears_nothing(transport)
            line, _ = server.accept()
            line.sendall(b"again")
            assert soon(transport).data == b"again"
            line.close()


def test_an_end_that_cannot_be_opened_is_one_sentence(other):
    port = other.getsockname()[1]
    for url, error, words in (
        (Url(Kind.UDP, HOST, port), LinkError, "Address already in use.*: check host and port"),
        (Url(Kind.TCP, HOST, port), NoAnswer, f"nothing answers at tcp:{HOST}:{port}: start the vehicle"),
        (Url(Kind.SERIAL, "/dev/none", 57600), LinkError, r"/dev/none:57600 cannot be opened \(No such file"),
    ):
        with pytest.raises(error, match=words):
            open_transport(url)


def test_a_serial_line_moves_bytes():
    with closing(Line()) as line, closing(open_transport(line.url)) as transport:
        os.write(line.ours, b"hello")
        assert soon(transport).data == b"hello"
        transport.send(b"answer", None)
        assert os.read(line.ours, 99) == b"answer"


def test_a_device_that_comes_back_under_its_name_is_opened_again(tmp_path):
    name = tmp_path / "by-id"
    first, second = Line(), Line()
    name.symlink_to(first.url.host)
    with closing(open_transport(replace(first.url, host=str(name)))) as transport, closing(second):
        address = heard(first, transport).address
        first.close()
        name.unlink()
        assert hears_nothing(transport)
        transport.send(b"lost", None)
        name.symlink_to(second.url.host)
        # the vehicle of before is heard: a link is locked to its address
        assert heard(second, transport).address == address


def test_a_board_that_comes_back_as_another_port_is_known_by_its_serial_number(monkeypatch):
    first, second, other = Line(), Line(), Line()
    ports = {first.url.host: "1A2B", other.url.host: "9C"}

    def comports():
        return [SimpleNamespace(device=at, vid=0x1209, pid=0x5740, serial_number=n) for at, n in ports.items()]

    monkeypatch.setattr("serial.tools.list_ports.comports", comports)
    with closing(open_transport(first.url)) as transport, closing(second), closing(other):
        address = heard(first, transport).address
        first.close()
        del ports[first.url.host]
        assert hears_nothing(transport)
        ports[second.url.host] = "1A2B"
        assert heard(second, transport).address == address
