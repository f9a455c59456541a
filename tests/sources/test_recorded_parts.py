"""Session in parts: recorded ones, then the rest, on one clock."""

import pytest

from mpucal.chip.access import RESUMED, Reply, SessionEvent, Transaction
from mpucal.sources.recorded_parts import split_at_resumes
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


def test_a_clock_continues_the_earlier_one():
    young = Young()
    bus = ReplayBus([read(7)], live=young)
    assert bus.open_next_part()
    bus.sleep_until(3 * S)
    assert young.slept_ns == []
    first_ns = bus.read(0x75, 1).t_ns
    assert first_ns == 8 * S
    assert bus.write(0x6B, b"\x00") == first_ns + 100
    bus.sleep_until(first_ns + 1000)
    assert young.slept_ns == [105 + 1000]


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
