from dataclasses import dataclass, field

import pytest

from mpucal.chip.access import Failure, Reply, Transaction
from mpucal.errors import BusError, EndOfCapture, NoAnswer
from mpucal.sources.tap import Tap


@dataclass
class Recorder:
    kept: list = field(default_factory=list)

    def transaction(self, transaction):
        self.kept.append(transaction)


@dataclass
class ScriptedBus:
    """Gives its answers one after the other; an exception among them is raised."""

    answers: list
    calls: list = field(default_factory=list)

    def _answer(self, *call):
        self.calls.append(call)
        answer = self.answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer

    def read(self, register, count):
        return self._answer("read", register, count)

    def write(self, register, data):
        return self._answer("write", register, data)

    def sleep_until(self, t_ns):
        self.calls.append(("sleep_until", t_ns))

    def close(self):
        self.calls.append(("close",))


@pytest.fixture
def recorder():
    return Recorder()


def test_passes_every_access_on_and_records_it(recorder):
    bus = ScriptedBus([Reply(b"\x68", 1000), 2000])
    tap = Tap(bus, recorder)
    assert tap.read(0x75, 1) == Reply(b"\x68", 1000)
    assert tap.write(0x6B, b"\x80") == 2000
    tap.sleep_until(3000)
    tap.close()
    assert bus.calls == [("read", 0x75, 1), ("write", 0x6B, b"\x80"), ("sleep_until", 3000), ("close",)]
    assert recorder.kept == [
        Transaction("read", 0x75, 1, b"\x68", 1000),
        Transaction("write", 0x6B, 1, b"\x80", 2000),
    ]


def test_records_a_failed_access_with_its_error_and_the_latest_known_time(recorder):
    tap = Tap(
        ScriptedBus(
            [
                NoAnswer("nothing at 0x68", "check the wires"),
                Reply(b"", 70),
                BusError("write failed", "try again"),
            ]
        ),
        recorder,
    )
    with pytest.raises(NoAnswer):
        tap.read(0x75, 1)
    tap.read(0x75, 0)
    tap.sleep_until(90)
    with pytest.raises(BusError, match="write failed"):
        tap.write(0x6B, b"\x01\x02")
    assert recorder.kept[0] == Transaction(
        "read", 0x75, 1, b"", 0, Failure("NoAnswer", "nothing at 0x68", "check the wires")
    )
    assert recorder.kept[2] == Transaction(
        "write", 0x6B, 2, b"\x01\x02", 90, Failure("BusError", "write failed", "try again")
    )


def test_the_end_of_a_source_is_no_access(recorder):
    with pytest.raises(EndOfCapture):
        Tap(ScriptedBus([EndOfCapture("over")]), recorder).read(0x75, 1)
    assert recorder.kept == []
