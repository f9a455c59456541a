"""Hostile peers for tools/attack/fuzz.py: bridges, vehicles and browsers, whose messages are mutated.

Mutated bytes would nearly always fail checksums and sequence numbers, so these are computed here: the bytes of a peer
are pieces, each a header that ends with a length, and that many bytes.
"""

import io
import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from mpucal.bridge import messages as wire
from mpucal.bridge.bus import BridgeBus
from mpucal.bridge.frame import MAX_PAYLOAD, Deframer, Frame
from mpucal.bridge.port import Chunk
from mpucal.bridge.store import BlobStore
from mpucal.chip import registers as reg
from mpucal.errors import LinkError
from mpucal.mavlink.dialect import Parser, dialect
from mpucal.mavlink.link import Link
from mpucal.mavlink.parameters.client import read_agreed, stream_parameter_names
from mpucal.mavlink.requests import is_armed
from mpucal.mavlink.transports import ReceivedBytes
from mpucal.page.requests import RequestFilter
from mpucal.page.server import Handler

MS = 1_000_000
# type, sequence number, length; if 0, type and sequence number are those that the request expects
PIECE_OF_BRIDGE = struct.Struct("<BBB")
# which of PACKETS, system, component, ms after the piece before, length
PIECE_OF_VEHICLE = struct.Struct("<BBBHB")
BEGUN_US = 1_000_000_000
PACKETS = (
    *("heartbeat", "raw_imu", "scaled_imu", "scaled_imu2", "scaled_imu3", "highres_imu", "attitude", "sys_status"),
    *("statustext", "command_ack", "param_value", "param_error", "file_transfer_protocol", "timesync", "system_time"),
    "autopilot_version",
)


def pieces(data: bytes, head: struct.Struct) -> Iterator[tuple[Any, ...]]:
    """Yield the fields of each header, with the bytes in place of their length."""
    at = 0
    while at + head.size <= len(data):
        *fields, size = head.unpack_from(data, at)
        at += head.size + size
        yield *fields, data[at - size : at]


def joined(head: struct.Struct, rows: Sequence[Sequence[Any]]) -> bytes:
    """Join pieces, the inverse of `pieces`."""
    return b"".join(head.pack(*fields, len(content)) + content for *fields, content in rows)


def frames(data: bytes) -> None:
    """Decode frames of a serial line."""
    for frame in Deframer().feed(data):
        if frame.type in wire.REQUESTS:
            wire.REQUESTS[frame.type].decode(frame.payload)
        else:
            wire.answer_of(frame.type, frame.payload)


class HostileBridge:
    """Port that receives one piece at each read, and then nothing."""

    name = "a port"
    bauds: tuple[int, ...] = (115200,)

    def __init__(self, data: bytes) -> None:
        self._pieces, self._t_ns = pieces(data, PIECE_OF_BRIDGE), 0
        self._waiting, self._asked = list[Frame](), Frame(0, 0)

    def now_ns(self) -> int:
        """Return the time; each read takes a millisecond."""
        return self._t_ns

    def read(self, until_ns: int) -> Chunk | None:
        """Return the next piece, as an answer to the oldest request; see Port."""
        kind, seq, payload = next(self._pieces, (None, 0, b""))
        if kind is None:
            self._t_ns = max(self._t_ns, until_ns)
            return None
        self._t_ns += MS
        if self._waiting and not kind:
            self._asked = self._waiting.pop(0)
        frame = Frame(kind or self._asked.type | wire.REPLY_BIT, seq or self._asked.seq, payload[:MAX_PAYLOAD])
        return Chunk(frame.encode(), self._t_ns)

    def write(self, data: bytes) -> None:
        """Remember the requests."""
        self._waiting += Deframer().feed(data)

    def close(self, *_: object) -> None:
        """Do nothing; see Port."""

    set_baud = reopen = revive = close


def bridge(data: bytes) -> None:
    """Ask a bridge for its identity, its blob and a chip's registers, and read the samples that it pushes."""
    bus = BridgeBus(HostileBridge(data))
    store = BlobStore(bus.link)
    store.who_am_i()
    store.read()
    bus.read(reg.WHO_AM_I, 1)
    bus.read(reg.INT_STATUS, 15)
    bus.write(reg.FIFO_EN, b"\x78")
    bus.write(reg.USER_CTRL, bytes([reg.USER_CTRL_FIFO_EN | reg.USER_CTRL_FIFO_RESET]))
    for _ in range(3):
        count = int.from_bytes(bus.read(reg.FIFO_COUNT_H, 2).data, "big")
        bus.read(reg.INT_STATUS, 1)
        bus.read(reg.FIFO_R_W, min(count, 1024) or 1)


def bridge_says() -> list[bytes]:
    """Return the replies of an honest bridge, in the order of the requests of `bridge`."""
    ok = struct.pack("<BI", 0, 1000)
    hello = wire.HelloReply(0, 1000, wire.MAGIC, 1, 0, 0x68, 7, 3, 512, b"bridge").payload()
    blob = bytes(range(60))
    state = wire.BlobStateReply(0, 2000, 1, len(blob), 7).payload()
    pushed = wire.Frames(0, 3000, 0, 0, 0, bytes(48)).payload()
    answers = [hello, ok + b"\x68", state, ok + blob[:56], ok + blob[56:], ok + b"\x68", ok + bytes(15), ok, ok, ok]
    said = joined(PIECE_OF_BRIDGE, [(0, 0, answer) for answer in answers])
    return [said + joined(PIECE_OF_BRIDGE, [(wire.Frames.TYPE, 0, pushed), (0, 0, ok + b"\1")] * 6)]


def packets(data: bytes) -> None:
    """Read the packets as a datagram, and as a stream."""
    for packet in Parser(dialect().MAVLink(None)).datagram(data):
        packet.message.to_dict()
    list(Parser(dialect().MAVLink(None)).stream(data))


def vehicles(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield times [us] and packets with valid checksums."""
    m, t_us = dialect(), BEGUN_US
    for number, (which, system, component, step_ms, payload) in enumerate(pieces(data, PIECE_OF_VEHICLE)):
        t_us += 1000 * step_ms
        kind = getattr(m, f"MAVLink_{PACKETS[which % len(PACKETS)]}_message")
        id_ = kind.id.to_bytes(3, "little")
        body = struct.pack("<BBBBBB", len(payload), 0, 0, number % 256, system, component) + id_ + payload
        crc = m.x25crc(body + bytes([kind.crc_extra])).crc
        yield t_us, b"\xfd" + body + struct.pack("<H", crc)


def tlog(data: bytes) -> bytes:
    """Return the packets as a ground station records them."""
    return b"".join(struct.pack(">Q", t_us) + packet for t_us, packet in vehicles(data))


class HostileVehicle:
    """Transport that receives the packets, and then nothing."""

    name, datagrams, outward = "a link", True, False

    def __init__(self, data: bytes) -> None:
        self._packets, self._t_us = vehicles(data), BEGUN_US

    def now_ns(self) -> int:
        """Return the time of the last packet, or later."""
        return self._t_us * 1000

    def receive(self, until_ns: int) -> ReceivedBytes | None:
        """See Transport; after the last packet the link is gone."""
        t_us, packet = next(self._packets, (0, b""))
        if not packet:
            raise LinkError("it says no more", "")
        self._t_us = max(self._t_us, t_us)
        return ReceivedBytes(packet, "192.0.2.1:1", self.now_ns())

    def close(self, *_: object) -> None:
        """Do nothing; see Transport."""

    send = restrict = close


def vehicle(data: bytes) -> None:
    """Ask a vehicle for its identity, and its parameters."""
    link = Link(HostileVehicle(data), lambda t_ns, packet: None)
    found = link.listen()
    link.lock(found[0])
    is_armed(link)
    read_agreed(link, stream_parameter_names(link.vehicle.firmware)[:2])


def vehicle_says() -> list[bytes]:
    """Return the messages of a vehicle in a second, and its replies to the requests of `vehicle`."""
    m, link = dialect(), dialect().MAVLink(None, 1, 1)

    def piece(message: Any) -> tuple[int, int, int, int, bytes]:
        packet, name = bytes(message.pack(link)), message.get_type().lower()
        return PACKETS.index(name), 1, 1, 800 if message is beat else 20, packet[10:-2]

    beat = m.MAVLink_heartbeat_message(2, 3, 81, 0, 3, 3)
    imus = [m.MAVLink_raw_imu_message(20_000 * n, 9, 0, -1000, n, 2, 3, 0, 0, 0, 0, 2500) for n in range(40)]
    values = (0.5, 0.0, -9.8, 0.1, 0.2, 0.3, *[0.0] * 7)
    more = [m.MAVLink_highres_imu_message(20_000 * n, *values, 63) for n in range(40)]
    names = stream_parameter_names("ArduPilot")[:2]
    held = [m.MAVLink_param_value_message(name.encode(), 0.5, 9, 9, 1) for name in names * 3]
    text = m.MAVLink_statustext_message(6, b'mpucal {"name":"key","data":{"key":"enough"}}', 1, 0)
    asked = joined(PIECE_OF_VEHICLE, [piece(one) for one in (*[beat] * 3, *held, text, beat)])
    return [asked, *(joined(PIECE_OF_VEHICLE, [piece(one) for one in (beat, text, *kind)]) for kind in (imus, more))]


def http(data: bytes) -> None:
    """Serve the request of a browser."""
    page = SimpleNamespace(
        filter=RequestFilter("h:1", "t", True),
        results={"report.html": Path(__file__)},
        pressed=lambda key: None,
        seat=lambda: False,
    )
    nothing = dict.fromkeys(("sendall", "settimeout", "setsockopt"), lambda *_: None)
    connection = SimpleNamespace(recv=io.BytesIO(data).read, makefile=lambda *how: io.BytesIO(), **nothing)
    Handler(connection, ("192.0.2.1", 1), page)  # type: ignore[arg-type]


def browser_says() -> list[bytes]:
    """Return requests of browsers."""
    targets = [
        "GET /t/",
        "GET /t/page.js",
        "GET /t/events",
        "GET /t/results/report.html",
        "POST /t/keys/redo",
        "PUT /x",
    ]
    return [f"{target} HTTP/1.1\r\nHost: h:1\r\nOrigin: http://h:1\r\n\r\n".encode() for target in targets]
