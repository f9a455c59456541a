"""Real sockets on loopback, and a pseudo terminal."""

import os
import pty
import socket
import tty
from contextlib import closing

import pytest

from mpucal.errors import LinkError, NoAnswer
from mpucal.mavlink.transports import open_transport
from mpucal.mavlink.url import Kind, Url

SOON_NS = 5_000_000_000


@pytest.fixture
def other():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        line.bind(("127.0.0.1", 0))
        line.settimeout(5)
        yield line


def free_udp():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        line.bind(("127.0.0.1", 0))
        return line.getsockname()[1]


def soon(transport):
    return transport.receive(transport.now_ns() + SOON_NS)


def test_udp_listens_and_answers_who_sent(other):
    port = free_udp()
    with closing(open_transport(Url(Kind.UDP, "127.0.0.1", port))) as transport:
        other.sendto(b"hello", ("127.0.0.1", port))
        received = soon(transport)
        assert received.data == b"hello"
        assert received.address == f"127.0.0.1:{other.getsockname()[1]}"
        assert received.t_ns % 1000 == 0
        transport.send(b"answer", received.address)
        assert other.recv(99) == b"answer"
        assert not transport.outward


def test_the_kernel_turns_strangers_away_once_the_vehicle_is_known(other):
    port = free_udp()
    with closing(open_transport(Url(Kind.UDP, "127.0.0.1", port))) as transport:
        other.sendto(b"vehicle", ("127.0.0.1", port))
        transport.settle(soon(transport).address)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            stranger.sendto(b"stranger", ("127.0.0.1", port))
        other.sendto(b"again", ("127.0.0.1", port))
        assert soon(transport).data == b"again"
        transport.send(b"answer", None)
        assert other.recv(99) == b"answer"


def test_udpout_speaks_first(other):
    with closing(open_transport(Url(Kind.UDPOUT, "127.0.0.1", other.getsockname()[1]))) as transport:
        transport.send(b"hello", None)
        data, address = other.recvfrom(99)
        other.sendto(data + b" you", address)
        assert soon(transport).data == b"hello you"


def test_a_partner_that_is_not_there_yet_is_waited_for():
    with closing(open_transport(Url(Kind.UDPOUT, "127.0.0.1", free_udp()))) as transport:
        transport.send(b"hello", None)
        assert transport.receive(transport.now_ns() + 20_000_000) is None


def test_a_taken_port_is_one_sentence(other):
    with pytest.raises(LinkError, match=r"Address already in use.*: check host and port"):
        open_transport(Url(Kind.UDP, "127.0.0.1", other.getsockname()[1]))


def test_tcp_moves_bytes_and_says_when_it_is_closed():
    with socket.create_server(("127.0.0.1", 0)) as server:
        transport = open_transport(Url(Kind.TCP, "127.0.0.1", server.getsockname()[1]))
        line, _ = server.accept()
    with closing(transport):
        line.sendall(b"hello")
        assert soon(transport).data == b"hello"
        transport.send(b"answer", "whoever")
        assert line.recv(99) == b"answer"
        line.close()
        with pytest.raises(LinkError, match="closed the connection"):
            soon(transport)


def test_nobody_at_a_tcp_port():
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with pytest.raises(NoAnswer, match=f"nothing answers at tcp:127.0.0.1:{port}: start the vehicle"):
        open_transport(Url(Kind.TCP, "127.0.0.1", port))


def test_a_serial_line_moves_bytes_and_says_when_it_is_gone():
    ours, theirs = pty.openpty()
    tty.setraw(ours)
    with closing(open_transport(Url(Kind.SERIAL, os.ttyname(theirs), 57600))) as transport:
        os.write(ours, b"hello")
        assert soon(transport).data == b"hello"
        transport.send(b"answer", None)
        assert os.read(ours, 99) == b"answer"
        os.close(ours)
        with pytest.raises(LinkError, match="broke"):
            soon(transport)
    os.close(theirs)


def test_no_such_device():
    with pytest.raises(LinkError, match=r"/dev/none:57600 cannot be opened \(No such file"):
        open_transport(Url(Kind.SERIAL, "/dev/none", 57600))
