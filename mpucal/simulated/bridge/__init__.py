"""Emulated bridge: the firmware's behaviour byte for byte, with any bus as its I2C bus.

It replaces a microcontroller in tests and trials. See firmware_protocol.md.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ...chip.access import Bus
from ...errors import BusError, NoAnswer
from ...result.blob import MAX_LENGTH
from ...sources.bridge import messages as wire
from ...sources.bridge.clock import US, WRAP_US
from ...sources.bridge.frame import Deframer, Frame
from ...sources.bridge.messages import Frames, Message, Reply, Status
from .blob_handler import BlobHandler
from .frame_streamer import FrameStreamer
from .line import EmulatedLine
from .storage import Memory

__all__ = ["EmulatedBridge", "EmulatedLine", "Memory"]

ADDRESSES = (0x68, 0x69)
MOST_ADDRESS = 0x7F
# Length of magic, major and minor
VERSION_BYTES = 6
NAME = b"emulated bridge"


class EmulatedBridge:
    """Bridge with a chip on it; its owner carries its bytes and calls `work`.

    Parameters
    ----------
    chip : at `address`; None: nothing is connected. now_ns : its clock. memory : its EEPROM.
    features : optional ones that it has. window : number of requests that it accepts at once.
    """

    def __init__(
        self,
        chip: Bus | None,
        now_ns: Callable[[], int],
        memory: Memory | None = None,
        *,
        address: int = ADDRESSES[0],
        features: wire.Feature = wire.Feature.STREAM | wire.Feature.BLOB,
        window: int = 4,
    ) -> None:
        self._chip, self._now_ns, self._address = chip, now_ns, address
        self._blobs = BlobHandler(memory or Memory())
        self._features, self._window = features, window
        self._deframer = Deframer()
        self._inbox: list[Frame] = []
        self._greeted = False
        self._chosen = 0
        self._drops = 0
        self._streamer: FrameStreamer | None = None

    def receive(self, data: bytes) -> None:
        """Take bytes from the host."""
        self._inbox += [frame for frame in self._deframer.feed(data) if not frame.type & wire.REPLY_BIT]

    def work(self) -> bytes:
        """Handle what came, and return the bytes to the host; to be called once a millisecond."""
        out = [self._handle(frame) for frame in self._inbox]
        self._inbox.clear()
        streamer = self._streamer
        if streamer is not None:
            out += [_encode(Frames.TYPE, streamer.seq, frames) for frames in streamer.poll()]
        return b"".join(out)

    def _handle(self, frame: Frame) -> bytes:
        kind = frame.type | wire.REPLY_BIT
        return b"".join(_encode(kind, frame.seq, reply) for reply in self._answer(frame))

    def _answer(self, frame: Frame) -> Sequence[Reply]:
        kind = wire.REQUESTS.get(frame.type)
        if not self._greeted and kind is not wire.Hello:
            return [self._status(Status.NO_HELLO)]
        other = kind is wire.Hello and frame.payload[4:5] != bytes([wire.MAJOR]) and len(frame.payload) >= VERSION_BYTES
        try:
            # Another major version has at least these bytes.
            payload = frame.payload[:VERSION_BYTES] + b"\0" if other else frame.payload
            request = None if kind is None else kind.decode(payload)
        except wire.MessageError:
            return [self._status(Status.BAD_PAYLOAD)]
        try:
            return self._dispatch(request, frame.seq)
        except NoAnswer:
            return [self._status(Status.NO_ANSWER)]
        except BusError:
            return [self._status(Status.BUS_FAILED)]

    def _dispatch(self, request: Message | None, seq: int) -> Sequence[Reply]:
        match request:
            case wire.Hello():
                return [self._hello(request)]
            case wire.Read():
                return [self._read(request)]
            case wire.Burst():
                return self._burst(request)
            case wire.Write():
                return [self._write(request)]
            case wire.Stream() if wire.Feature.STREAM in self._features:
                return [self._stream(request, seq)]
            case wire.Message() if wire.Feature.BLOB in self._features:
                reply = self._blobs.answer(request, self._time())
                if isinstance(request, wire.BlobBegin) and reply.status == Status.OK:
                    self._stop()
                return [reply]
        return [self._status(Status.UNKNOWN_TYPE)]

    def _time(self) -> int:
        return self._now_ns() // US % WRAP_US

    def _status(self, status: Status) -> Reply:
        return Reply(status, self._time())

    def _hello(self, request: wire.Hello) -> Reply:
        if request.magic != wire.MAGIC or (request.major == wire.MAJOR and request.address > MOST_ADDRESS):
            return self._status(Status.BAD_PAYLOAD)
        status = Status.OK if request.major == wire.MAJOR else Status.BAD_VERSION
        if status == Status.OK:
            asked = (request.address,) if request.address else ADDRESSES
            self._chosen = self._address if self._chip is not None and self._address in asked else 0
            self._greeted, self._streamer, self._drops = True, None, 0
            self._blobs.discard()
        room = MAX_LENGTH if wire.Feature.BLOB in self._features else 0
        identity = (wire.MAGIC, wire.MAJOR, wire.MINOR, self._chosen)
        occupied = wire.Feature.OCCUPIED if room and self._blobs.occupied else 0
        return wire.HelloReply(
            status, self._time(), *identity, self._features | occupied, self._window, room, NAME.ljust(16, b"\0")
        )

    def _bus(self) -> Bus:
        if self._chip is None or not self._chosen:
            raise NoAnswer("nothing answers the emulated bridge", "connect a chip")
        return self._chip

    def _read(self, request: wire.Read) -> Reply:
        if not 1 <= request.count <= wire.MAX_READ:
            return self._status(Status.BAD_PAYLOAD)
        began = self._time()
        return wire.ReadReply(Status.OK, began, self._bus().read(request.register, request.count).data)

    def _burst(self, request: wire.Burst) -> list[Reply]:
        if not 1 <= request.count <= wire.MAX_BURST:
            return [self._status(Status.BAD_PAYLOAD)]
        replies: list[Reply] = []
        for offset in range(0, request.count, wire.MAX_READ):
            began, count = self._time(), min(wire.MAX_READ, request.count - offset)
            replies.append(wire.BurstReply(Status.OK, began, offset, self._bus().read(request.register, count).data))
        return replies

    def _write(self, request: wire.Write) -> Reply:
        if not 1 <= len(request.data) <= wire.MAX_WRITE:
            return self._status(Status.BAD_PAYLOAD)
        began = self._time()
        self._bus().write(request.register, request.data)
        return wire.WriteReply(Status.OK, began)

    def _stream(self, request: wire.Stream, seq: int) -> Reply:
        if request.frame_bytes > wire.MAX_READ or (request.frame_bytes and not 1 <= request.batch <= wire.MAX_BATCH):
            return self._status(Status.BAD_PAYLOAD)
        self._stop()
        if request.frame_bytes:
            self._streamer = FrameStreamer(self._bus, seq, request, self._drops, self._now_ns)
        return wire.StreamReply(Status.OK, self._time())

    def _stop(self) -> None:
        if self._streamer is not None:
            self._drops, self._streamer = self._streamer.drops, None


def _encode(kind: int, seq: int, reply: Reply) -> bytes:
    return Frame(kind, seq, reply.payload()).encode()
