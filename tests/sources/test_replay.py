import pytest

from mpucal.chip.access import Failure, SessionEvent, Transaction
from mpucal.errors import BusError, CaptureError, NoAnswer
from mpucal.sources.replay import ReplayBus

READ = Transaction("read", 0x75, 1, b"\x68", 1000)
WRITE = Transaction("write", 0x6B, 1, b"\x80", 2000)
FIFO = Transaction("read", 0x74, 3, b"\1\2\3", 3000)


def key(t_ns):
    return SessionEvent("key", t_ns, {"key": "enough"})


@pytest.mark.parametrize(
    ("recorded", "access", "words"),
    [
        pytest.param(
            READ,
            lambda bus: bus.read(0x74, 1),
            ["read of 1 bytes from 0x74", "read of 1 bytes from 0x75"],
            id="another register",
        ),
        pytest.param(
            READ,
            lambda bus: bus.write(0x75, b"\x68"),
            ["write of 68 to 0x75", "read of 1"],
            id="a write for a read",
        ),
        pytest.param(WRITE, lambda bus: bus.write(0x6B, b"\x01"), ["write of 01", "of 80 to 0x6b"], id="other bytes"),
    ],
)
def test_refuses_an_access_that_the_capture_does_not_hold(recorded, access, words):
    bus = ReplayBus([FIFO, recorded], "old.mcap")
    bus.read(0x74, 3)
    with pytest.raises(CaptureError, match=r"access 1 of old\.mcap") as raised:
        access(bus)
    for word in words:
        assert word in str(raised.value)
    assert bus.unread() == 1


@pytest.mark.parametrize(
    ("failure", "kind"),
    [
        (Failure("NoAnswer", "nothing at 0x68", "check the wires"), NoAnswer),
        (Failure("BusErrorOfTheFuture", "the transfer failed", "try again"), BusError),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_raises_the_recorded_error_and_goes_on(failure, kind):
    bus = ReplayBus([Transaction("read", 0x75, 1, b"", 0, failure), READ])
    with pytest.raises(BusError) as raised:
        bus.read(0x75, 1)
    assert type(raised.value) is kind
    assert (raised.value.what, raised.value.remedy) == (failure.what, failure.remedy)
    assert bus.read(0x75, 1).data == b"\x68"


def test_events_come_between_the_accesses_they_were_recorded_between():
    a, b, c, d = map(key, (1, 1500, 1600, 2500))
    bus = ReplayBus([a, READ, b, c, WRITE, d])
    assert bus.pending_events("key") == [a]
    assert bus.pending_events("key") == []
    bus.read(0x75, 1)
    assert bus.pending_events("key") == [b, c]
    bus.write(0x6B, b"\x80")
    assert bus.pending_events("key") == [d]
