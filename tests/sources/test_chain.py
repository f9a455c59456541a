"""Session in parts: recorded ones, then the rest, on one clock."""

import pytest

from mpucal.chip.access import Reply, Transaction
from mpucal.chip.records import RESUMED, SessionEvent
from mpucal.errors import EndOfCapture
from mpucal.mavlink.tlog import RawPacket
from mpucal.mavlink.transport import ReceivedBytes
from mpucal.sources.chain import PAUSE_NS, ChainedBus, ChainedTransport, ShiftedClockBus, split_at_resumes
from mpucal.sources.packet_replay import PacketReplay
from mpucal.sources.replay import ReplayBus

S = 1_000_000_000


def read(t_s, register=0x75):
    return Transaction("read", register, 1, b"\x68", round(t_s * S))


def event(name, **data):
    return SessionEvent(name, 0, data)


def key(name):
    return event("key", key=name)


class Young:
    """Bus that was just opened."""

    def __init__(self):
        self.t_ns, self.slept_ns = 5, []

    def read(self, register, count):
        self.t_ns += 100
        return Reply(bytes(count), self.t_ns)

    def write(self, register, data):
        self.t_ns += 100
        return self.t_ns

    def sleep_until(self, t_ns):
        self.slept_ns.append(t_ns)

    def close(self):
        self.closed = True


def test_each_part_ends_before_the_next_begins():
    bus = ChainedBus([ReplayBus([read(1), key("enough")]), ReplayBus([read(2)])])
    assert bus.read(0x75, 1).t_ns == S
    assert [found.name for found in bus.pending_events("key")] == ["key"]
    with pytest.raises(EndOfCapture):
        bus.read(0x75, 1)
    assert bus.go_on()
    assert bus.unread() == 1
    assert bus.read(0x75, 1).t_ns == 2 * S
    assert bus.unread() == 0
    assert not bus.go_on()


def test_only_what_was_recorded_is_replayed():
    young = Young()
    bus = ChainedBus([ReplayBus([]), young])
    assert bus.replaying
    bus.go_on()
    assert not bus.replaying
    assert bus.pending_events("key") == []
    assert bus.unread() == 0
    bus.close()
    assert young.closed


class YoungLink:
    """Transport whose clock was set back, and which hears a byte after each 10 ms."""

    name, datagrams, outward = "young", False, True

    def __init__(self):
        self.t_ns = 5

    def now_ns(self):
        return self.t_ns

    def receive(self, until_ns):
        self.t_ns = min(self.t_ns + S // 100, until_ns)
        return ReceivedBytes(b"x", "young", self.t_ns) if self.t_ns < until_ns else None


def test_a_link_continues_the_time_of_the_packets_before_it():
    packet = RawPacket(6 * S, bytes([0xFE, 0, 0, 1, 1, 0, 0, 0]))
    link = ChainedTransport([PacketReplay([packet, event(RESUMED)], "capture"), YoungLink()], 7 * S)
    assert link.receive(8 * S) == ReceivedBytes(packet.data, "capture", 6 * S)
    with pytest.raises(EndOfCapture):
        link.receive(8 * S)
    assert (link.outward, link.replaying, link.resumes) == (False, True, True)
    assert link.go_on()
    assert (link.outward, link.replaying, link.name) == (True, False, "young")
    begun_ns = link.now_ns()
    assert begun_ns == 7 * S + PAUSE_NS
    assert link.receive(begun_ns + S) == ReceivedBytes(b"x", "young", begun_ns + S // 100)
    assert link.receive(begun_ns + S // 50) is None
    assert link.now_ns() == begun_ns + S // 50
    assert not link.go_on()


def test_a_clock_continues_the_earlier_one():
    young = Young()
    bus = ShiftedClockBus(young, 7 * S)
    bus.sleep_until(3 * S)
    assert young.slept_ns == []
    first_ns = bus.read(0x75, 1).t_ns
    assert first_ns == 7 * S + PAUSE_NS
    assert bus.write(0x6B, b"\x00") == first_ns + 100
    bus.sleep_until(first_ns + 1000)
    assert young.slept_ns == [105 + 1000]


def test_a_clock_that_is_later_by_itself_stays():
    young = Young()
    young.t_ns = 100 * S
    assert ShiftedClockBus(young, 7 * S).read(0x75, 1).t_ns == young.t_ns


@pytest.mark.parametrize(
    ("captures", "more", "lengths"),
    [
        ([[read(1), read(2)]], False, [2]),
        ([[read(1)], [event(RESUMED), read(2)]], False, [1, 2]),
        ([[read(1), event(RESUMED), read(2), read(3)]], False, [1, 3]),
        ([[read(1), key("abort"), read(2)], [event(RESUMED), read(3)]], False, [1, 2]),
        ([[read(1), key("abort"), read(2)]], False, [3]),
        ([[read(1), key("abort"), read(2)]], True, [1]),
        ([[read(1), key("enough"), read(2)]], True, [3]),
    ],
    ids=["one", "two files", "one file of two", "stopped, then resumed", "stopped", "to be resumed", "another key"],
)
def test_captures_are_cut_where_they_were_resumed(captures, more, lengths):
    assert [len(part) for part in split_at_resumes(captures, more)] == lengths
