"""Stream of the core: the rules under FRAMES in firmware_protocol.md, one by one."""

import pytest

from mpucal.bridge import messages as wire
from mpucal.bridge.frame import Deframer, Frame
from mpucal.bridge.messages import Status

SEQ = 9
BYTES = 14
FIFO_OFLOW = 0x10


class Streaming:
    """Bridge that streams from a FIFO which the test fills; all bytes of a frame are its number."""

    def __init__(self, host, core, batch=4, frame_bytes=BYTES):
        self.fifo, self.status, self.failures = bytearray(), 0, {}
        self.reads = []
        self.frame_bytes, self.made = frame_bytes, 0
        self.bridge = host.HostBridge(core, host.Eeprom(), self._read, lambda *_: Status.OK)
        self.bridge.receive(Frame(wire.Hello.TYPE, 1, wire.Hello().payload()).encode())
        self.ask(wire.Stream(frame_bytes, batch))

    def _read(self, _address, first, count):
        self.reads.append((first, count))
        if first in self.failures:
            return self.failures[first], b""
        if first == 0x72:
            return Status.OK, len(self.fifo).to_bytes(2, "big")
        if first == 0x3A:
            return Status.OK, bytes([self.status])
        data = bytes(self.fifo[:count])
        del self.fifo[:count]
        return Status.OK, data

    def ask(self, request, seq=SEQ):
        return _messages(self.bridge.receive(Frame(request.TYPE, seq, request.payload()).encode()))

    def make(self, frames):
        """Fill the FIFO with frames."""
        for _ in range(frames):
            self.fifo += bytes([self.made % 256]) * self.frame_bytes
            self.made += 1

    def look(self, after_us=1000):
        """Return the messages that the bridge pushes `after_us` later."""
        self.bridge.now_us += after_us
        return _messages(self.bridge.look())

    def pushed(self, after_us=1000):
        """Return all messages of the look that is due."""
        messages = self.look(after_us)
        while messages and messages[-1].left:
            messages += self.look(10)
        return messages


def _messages(data):
    frames = list(Deframer().feed(data))
    assert {frame.seq for frame in frames if frame.type == wire.Frames.TYPE} <= {SEQ}
    return [wire.answer_of(frame.type, frame.payload) for frame in frames]


@pytest.fixture
def stream(host, core):
    return Streaming(host, core)


def numbers(*messages):
    return [number for message in messages for number in message.frames[::BYTES]]


def test_waits_for_a_batch_then_pushes_it_with_the_looks_time(stream):
    stream.make(3)
    assert stream.look() == []
    stream.make(1)
    (message,) = stream.look()
    assert (message.status, message.t_us, message.index, message.left) == (Status.OK, 2000, 0, 0)
    assert numbers(message) == [0, 1, 2, 3]


def test_looks_at_least_once_a_millisecond_and_not_all_the_time(stream):
    del stream.reads[:]
    for _ in range(2000):
        stream.look(10)
    counts = [read for read in stream.reads if read == (0x72, 2)]
    assert 20 <= len(counts) <= 50


@pytest.mark.parametrize("frames", [5, 8, 73])
def test_all_that_was_counted_comes_in_as_few_messages_as_hold_it(frames, stream):
    stream.make(frames)
    messages = stream.pushed()
    stream.make(1)
    assert numbers(*messages) == list(range(frames))
    assert len(messages) == -(-frames // 4)
    assert len({message.t_us for message in messages}) == 1
    assert [message.left for message in messages] == [max(0, frames - 4 * (i + 1)) for i in range(len(messages))]
    assert [message.index for message in messages] == list(range(0, frames, 4))


def test_frames_that_come_during_a_look_are_left_to_the_next(stream):
    stream.make(8)
    first = stream.look()
    stream.make(2)
    second = stream.look(10)
    assert (numbers(*first), numbers(*second), len(stream.fifo)) == ([0, 1, 2, 3], [4, 5, 6, 7], 2 * BYTES)


def test_pushes_a_message_every_100_ms_even_without_frames(stream):
    stream.make(1)
    assert [numbers(message) for message in stream.look(100_000)] == [[0]]
    assert stream.look(99_000) == []
    assert [(message.index, message.frames) for message in stream.look(1000)] == [(1, b"")]


def test_an_overflow_while_it_was_read_takes_the_last_message_away(stream):
    stream.make(8)
    stream.status = FIFO_OFLOW
    first, last = stream.pushed()
    assert (first.status, numbers(first)) == (Status.OK, [0, 1, 2, 3])
    assert (last.status, last.drops, last.index, last.left, last.frames) == (Status.OVERFLOW, 1, 4, 0, b"")


@pytest.mark.parametrize("code", [Status.NO_ANSWER, Status.BUS_FAILED])
def test_a_transfer_that_fails_halts_the_stream(code, host, core):
    for register in (0x72, 0x74, 0x3A):
        stream = Streaming(host, core)
        stream.make(4)
        stream.failures[register] = code
        (message,) = stream.look()
        assert (message.status, message.drops, message.frames) == (code, 1, b""), register


def test_more_frames_than_a_chip_holds_are_an_overflow_reported_every_100_ms(stream):
    stream.make(74)
    (message,) = stream.look()
    assert (message.status, message.drops, message.left, message.frames) == (Status.OVERFLOW, 1, 0, b"")
    del stream.reads[:]
    assert stream.look(99_000) == []
    (message,) = stream.look(1000)
    assert (message.status, message.drops, message.t_us) == (Status.OVERFLOW, 1, stream.bridge.now_us)
    assert stream.reads == []


def test_a_restarted_stream_counts_its_drops_on_until_a_hello(stream):
    for hello, drops in ((False, 1), (True, 0)):
        stream.make(74)
        stream.look()
        if hello:
            stream.ask(wire.Hello())
            assert stream.look(200_000) == []
        stream.fifo.clear()
        assert [reply.status for reply in stream.ask(wire.Stream(BYTES, 4))] == [Status.OK]
        stream.make(4)
        (message,) = stream.look()
        assert (message.status, message.index, message.drops) == (Status.OK, 0, drops)


@pytest.mark.parametrize("request_", [wire.Stream(0, 0), wire.BlobBegin(188)], ids=["stop", "blob"])
def test_stops_on_request_even_within_a_look(request_, stream):
    stream.make(8)
    stream.look()
    (reply,) = stream.ask(request_)
    assert reply.status == Status.OK
    assert stream.look(200_000) == []


def test_requests_are_answered_between_messages_of_a_look(stream):
    stream.make(8)
    stream.look()
    assert [reply.data for reply in stream.ask(wire.Read(0x3A, 1))] == [b"\0"]
    assert numbers(*stream.look(10)) == [4, 5, 6, 7]


@pytest.mark.parametrize("frame_bytes", [1, 20, 56])
def test_frames_of_any_length_are_pushed_whole(frame_bytes, host, core):
    stream = Streaming(host, core, batch=1, frame_bytes=frame_bytes)
    stream.make(7)
    messages = stream.pushed()
    assert b"".join(message.frames for message in messages) == bytes(
        number for number in range(7) for _ in range(frame_bytes)
    )
    assert {len(message.frames) % frame_bytes for message in messages} == {0}


def test_index_and_clock_wrap(host, core):
    stream = Streaming(host, core, batch=32, frame_bytes=1)
    stream.bridge.now_us = 2**32 - 1500
    stream.ask(wire.Stream(1, 32))
    indices = []
    for _ in range(2**16 // 56 + 2):
        stream.make(56)
        stream.bridge.now_us %= 2**32
        indices += [message.index for message in stream.look()]
    assert indices == [(56 * i) % 2**16 for i in range(2**16 // 56 + 2)]
