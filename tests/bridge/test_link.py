from dataclasses import replace

import pytest

from mpucal.bridge.frame import Deframer, Frame
from mpucal.bridge.link import Link, LinkLost
from mpucal.bridge.messages import Burst, HelloReply, Read, Status
from mpucal.chip import registers as reg
from mpucal.errors import BusError

WHO = Read(reg.WHO_AM_I, 1)


@pytest.fixture
def link(rig):
    made = rig()
    made.link = Link(made.line)
    made.link.greet()
    made.line.written.clear()
    return made


def sent(line):
    return list(Deframer().feed(bytes(line.written)))


def lose(line, replies):
    """Lose the next `replies` pieces that the bridge sends."""
    left = iter(range(replies))
    line.to_host = lambda data: data if next(left, None) is None else b""


@pytest.mark.parametrize(
    "request_",
    [Read(reg.FIFO_R_W, 14), Read(reg.INT_STATUS, 1), Read(reg.INT_ENABLE, 3), Burst(reg.FIFO_R_W, 70)],
    ids=repr,
)
def test_a_destructive_read_is_never_repeated(link, request_):
    lose(link.line, 1)
    with pytest.raises(LinkLost, match="no longer answers"):
        link.link.ask(request_)
    assert len(sent(link.line)) == 1


@pytest.mark.parametrize(
    ("theirs", "status", "remedy"),
    [(2, Status.BAD_VERSION, "newer mpucal on this machine"), (0, Status.OK, "newer firmware on the bridge")],
    ids=["newer", "older"],
)
def test_another_version_is_named(rig, theirs, status, remedy):
    made = rig()

    def other(data):
        made_of = [
            Frame(f.type, f.seq, replace(HelloReply.decode(f.payload), status=status, major=theirs).payload()).encode()
            for f in Deframer().feed(data)
        ]
        return b"".join(made_of)

    made.line.to_host = other
    with pytest.raises(BusError, match=f"speaks version {theirs} of the protocol, and mpucal 1: put a {remedy}"):
        Link(made.line).greet()


def test_both_rates_are_tried_in_turn(rig):
    made, rates = rig(), []
    made.line.bauds = (500_000, 115_200)
    made.line.set_baud = rates.append
    made.line.to_device = lambda data: data if rates[-1] == 115_200 else b"\xf0" * len(data)
    Link(made.line).greet()
    assert rates == [500_000, 115_200]


def test_an_unknown_status_is_a_failure_and_named(rig):
    made = rig()
    bus = made.bus()

    def odd(data):
        return b"".join(Frame(f.type, f.seq, b"\x63" + f.payload[1:]).encode() for f in Deframer().feed(data))

    made.line.to_host = odd
    with pytest.raises(BusError, match="answers with status 99: put a newer mpucal"):
        bus.read(reg.WHO_AM_I, 1)


@pytest.mark.parametrize("data", [b"", b"\x68\x68"], ids=["too few bytes", "too many"])
def test_other_bytes_than_were_asked_for_are_no_answer(link, data):
    link.line.to_host = lambda said: b"".join(
        Frame(f.type, f.seq, f.payload[:5] + data).encode() for f in Deframer().feed(said)
    )
    with pytest.raises(LinkLost, match="no longer answers"):
        link.link.ask(WHO)
