"""Captures as MCAP files: every register access, or packet of a vehicle, and session event in order.

While a capture is written, a chunk with one message of register accesses holds half a second. A closed capture is
rewritten with longer chunks, which take half the space and are read several times as fast: each is a tenth of the part
before it, so that little is lost if the file is cut.
"""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Self, cast

from mcap.exceptions import McapError, RecordLengthLimitExceeded
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import MCAP0_MAGIC, CompressionType, IndexType, Writer
from zstandard import ZstdError, frame_content_size

from ..arguments import check_regular
from ..chip.access import Transaction
from ..chip.accesses import Accesses
from ..chip.records import SessionEvent
from ..disk.atomic import atomic_file
from ..disk.growing_file import GrowingFile
from ..errors import CaptureError, OutputError
from ..mavlink.tlog import RawPacket
from ..strict_json import parse_own_json
from .messages import (
    BUS,
    PACKETS,
    SESSION,
    accesses_schema,
    decode_message,
    encode_accesses,
    encode_event,
    event_schema,
)
from .reading import LONGEST_CHUNK

Record = Transaction | RawPacket | SessionEvent
# as a file holds records
Block = Accesses | RawPacket | SessionEvent

FORMAT, VERSION_KEY, VERSION = "mpucal.capture", "capture_version", 2
# the name of the metadata in a file of calibrated samples, which is not a capture
CALIBRATED = "mpucal.imu"

_REMEDY = "give a capture that mpucal recorded, or a bag with sensor_msgs/Imu"

# half of the second that a killed program may lose; the other half may pass between two records
CHUNK_NS = 500_000_000
# chunks of a closed capture: the longest, and the inverse share of the part before it
CLOSED_CHUNK_NS, CLOSED_CHUNK_PART = 10_000_000_000, 10

# errors of writing; ZstdError: out of memory. Of reading, the last two: a length that exceeds all memory
_FAILED = (OSError, ZstdError)
_DAMAGED_BYTES = (McapError, CRCValidationError, ZstdError, struct.error, UnicodeDecodeError, EOFError)
_DAMAGE = (*_DAMAGED_BYTES, OverflowError, MemoryError)


class CaptureWriter:
    """Writer of a capture during a session; a killed program loses the last second at most.

    Raises
    ------
    OutputError : the file cannot be created or written.
    """

    def __init__(self, path: str | Path) -> None:
        self._head: tuple[Mapping[str, Any], str] = ({}, BUS)
        self._file = GrowingFile(Path(path))
        self._stream = _Stream(cast("IO[bytes]", self._file), CHUNK_NS, IndexType.METADATA, self._file.kept)

    def start(self, meta: Mapping[str, Any], topic: str = BUS) -> None:
        """Write the metadata: source, program and settings, values of JSON types; `topic` is BUS or PACKETS."""
        self._head = (meta, topic)
        with self._writing():
            self._stream.start(meta, topic)

    def packet(self, t_ns: int, data: bytes) -> None:
        """Write a packet of MAVLink; the time is the host's clock."""
        with self._writing():
            self._stream.add(RawPacket(t_ns, data))

    def transaction(self, transaction: Transaction) -> None:
        """Write a register access; the message's publish time is the host's clock."""
        try:  # a third of the time of `with self._writing()`
            self._stream.add(transaction)
        except _FAILED as error:
            raise self._file.failed(error) from error

    def event(self, name: str, t_ns: int, data: Mapping[str, Any] | None = None) -> None:
        """Write a session event; `data` of JSON types."""
        with self._writing():
            self._stream.add(SessionEvent(name, t_ns, data or {}))

    def close(self) -> None:
        """Close the file, and rewrite it with longer chunks and their index if the disk has room for that."""
        with self._writing():
            try:
                self._stream.finish()
            finally:
                path = self._file.close()
        if self._stream.is_started and path is not None:
            # the file is complete without this, only longer
            with suppress(OutputError, CaptureError, ZstdError, MemoryError):
                self._with_longer_chunks(path)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        # the error that ends the block matters more
        with suppress(*(() if kind is None else (OutputError,))):
            self.close()

    def _with_longer_chunks(self, path: Path) -> None:
        with atomic_file(path) as file:
            stream, written = _Stream(file, CLOSED_CHUNK_NS), CaptureReader(path)
            stream.start(*self._head)
            for block in written.blocks():
                stream.add(block)
            stream.finish()
            if written.recovered:
                raise CaptureError(written.recovered, "keep it as it is")

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except _FAILED as error:
            raise self._file.failed(error) from error


class _Stream:
    """Encoder of a capture into an open file, which gathers accesses for a message and ends chunks.

    Parameters
    ----------
    longest_ns : of a chunk. index : what is indexed at the end. chunked : False to write no chunks.
    """

    def __init__(
        self, file: IO[bytes], longest_ns: int, index: IndexType = IndexType.ALL, chunked: bool = True
    ) -> None:
        self._writer = Writer(
            file, compression=CompressionType.ZSTD, index_types=index, enable_data_crcs=True, use_chunking=chunked
        )
        self._longest_ns, self._index = longest_ns, index
        self._channels: dict[str, int] = {}
        self._waiting: list[Transaction] = []
        self._blocks: list[Accesses] = []
        self._began_ns: int | None = None
        self._chunk_began_ns: int | None = None
        self._ahead_ns = 0

    @property
    def is_started(self) -> bool:
        return bool(self._channels)

    def start(self, meta: Mapping[str, Any], topic: str) -> None:
        self._writer.start(profile="", library=FORMAT)
        texts = {key: json.dumps(value) for key, value in {**meta, VERSION_KEY: VERSION}.items()}
        self._writer.add_metadata(FORMAT, texts)
        if topic == PACKETS:
            self._channels[PACKETS] = self._writer.register_channel(PACKETS, "mavlink", schema_id=0)
        else:
            self._register(BUS, MessageEncoding.Protobuf, "mpucal.Accesses", SchemaEncoding.Protobuf, accesses_schema())
        event = ("mpucal.SessionEvent", SchemaEncoding.JSONSchema, event_schema())
        self._register(SESSION, MessageEncoding.JSON, *event)
        self._writer.flush()

    def add(self, record: Record | Accesses) -> None:
        ends = (record.t_ns[0], record.t_ns[-1]) if isinstance(record, Accesses) else (record.t_ns, record.t_ns)
        begin_ns, t_ns = map(int, ends)
        if isinstance(record, SessionEvent):
            self._put_waiting()
            self._put(SESSION, t_ns, encode_event(record.name, record.data))
        elif isinstance(record, RawPacket):
            self._put(PACKETS, t_ns, record.data)
        elif isinstance(record, Accesses):
            if self._waiting or (self._blocks and not self._blocks[-1].can_join(record)):
                self._put_waiting()
            self._blocks.append(record)
        else:
            if self._blocks:
                self._put_waiting()
            self._waiting.append(record)
        if self._began_ns is None:
            self._began_ns = begin_ns
        chunk_ns = min(max(CHUNK_NS, (t_ns - self._began_ns) // CLOSED_CHUNK_PART), self._longest_ns)
        if self._chunk_began_ns is None:
            self._chunk_began_ns = begin_ns
        if t_ns - self._chunk_began_ns >= chunk_ns:
            self._put_waiting()
            self._writer.flush()
            if IndexType.CHUNK not in self._index:
                # the library keeps what it does not write: 8 MB an hour
                vars(self._writer).get("_Writer__chunk_indices", []).clear()
            self._chunk_began_ns = None

    def _register(self, topic: str, encoding: str, name: str, schema_encoding: str, schema: bytes) -> None:
        id_ = self._writer.register_schema(name, schema_encoding, schema)
        self._channels[topic] = self._writer.register_channel(topic, encoding, id_)

    def finish(self) -> None:
        if self.is_started:
            self._put_waiting()
            self._writer.finish()

    def _put_waiting(self) -> None:
        if self._blocks or self._waiting:
            accesses = Accesses.joined(self._blocks) if self._blocks else Accesses.from_transactions(self._waiting)
            self._blocks, self._waiting = [], []
            if accesses.has_host_ns.any():
                first = int(accesses.has_host_ns.argmax())
                self._ahead_ns = int(accesses.host_ns[first] - accesses.t_ns[first])
            self._put(BUS, int(accesses.t_ns[0]), encode_accesses(accesses))

    def _put(self, topic: str, t_ns: int, data: bytes) -> None:
        self._writer.add_message(self._channels[topic], t_ns, data, publish_time=max(t_ns + self._ahead_ns, 0))


@dataclass(frozen=True)
class Capture:
    """Content of a capture file.

    Attributes
    ----------
    meta : metadata of `CaptureWriter.start`. records : in order of time.
    recovered : None, or a sentence on the part of a damaged file that was read.
    name : of the file, for messages.
    """

    meta: Mapping[str, Any]
    records: tuple[Record, ...]
    recovered: str | None = None
    name: str = "the capture"


def read_capture(path: str | Path) -> Capture:
    """Read a capture; of a file that was cut short, the whole part.

    Raises
    ------
    CaptureError : the file cannot be read, or is not a capture of mpucal.
    """
    reader = CaptureReader(path)
    records = tuple(reader)
    return Capture(reader.meta, records, reader.recovered, reader.name)


class CaptureReader:
    """Iterator over the records of a capture, once; of a file that was cut short, over the whole part.

    Attributes
    ----------
    name : of the file, for messages. meta, recovered : see Capture; set with the first record, and when all are read.

    Raises
    ------
    CaptureError : the file cannot be read, or is not a capture of mpucal; perhaps only after some records.
    """

    def __init__(self, path: str | Path) -> None:
        self._path = Path(path)
        self.name = self._path.name
        self.meta: Mapping[str, Any] = {}
        self.recovered: str | None = None
        self._count = self._first_ns = self._last_ns = 0

    def __iter__(self) -> Iterator[Record]:
        return one_by_one(self.blocks())

    def blocks(self) -> Generator[Block]:
        """Yield the records, register accesses by the block as in the file."""
        try:
            with check_regular(self._path).open("rb") as file:
                yield from self._blocks(file)
        except OSError as error:
            raise CaptureError(
                f"cannot read {self._path} ({error.strerror})", "check the path and its permissions"
            ) from error

    def _blocks(self, file: IO[bytes]) -> Iterator[Block]:
        size = os.fstat(file.fileno()).st_size
        self._check(file.read(len(MCAP0_MAGIC)))
        file.seek(0)
        channels: dict[int, Channel] = {}
        headed = False
        whole, finished = 0, False
        stream = _SizeLimitedFile(file, size)
        items = _records(
            StreamReader(cast("IO[bytes]", stream), emit_chunks=True, validate_crcs=True, record_size_limit=size)
        )
        while not finished:
            try:
                item = next(items, None)
            except _DAMAGE:
                # everything read so far is whole; `recovered` tells the rest
                break
            whole, finished = stream.at, item is None
            if isinstance(item, Metadata) and item.name == FORMAT:
                self.meta, headed = _meta(item, self._path), True
            elif isinstance(item, Metadata) and item.name == CALIBRATED:
                raise CaptureError(
                    f"{self._path} holds samples that are calibrated already ({item.metadata.get('done')})",
                    "give the recording from which it was made",
                )
            elif isinstance(item, Channel):
                channels[item.id] = item
            elif isinstance(item, Message):
                block = self._block(channels.get(item.channel_id), item)
                if block is not None:
                    self._count_block(block)
                    yield block
        if not headed:
            raise CaptureError(f"{self._path} lacks the metadata of a capture", _REMEDY)
        self.recovered = None if finished else self._recovery_sentence(size - whole)

    def _block(self, channel: Channel | None, message: Message) -> Block | None:
        if channel is None:
            return None
        try:
            return decode_message(channel.topic, message.log_time, message.data)
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise CaptureError(
                f"{self._path} holds an invalid message on {channel.topic} ({error})", _REMEDY
            ) from error

    def _check(self, magic: bytes) -> None:
        if not magic:
            raise CaptureError(f"{self._path} is empty", "record it again")
        if magic != MCAP0_MAGIC:
            raise CaptureError(f"{self._path} is not an MCAP file", _REMEDY)

    def _count_block(self, block: Block) -> None:
        if isinstance(block, Accesses):
            first_ns, self._last_ns, count = int(block.t_ns[0]), int(block.t_ns[-1]), len(block)
        else:
            first_ns, self._last_ns, count = block.t_ns, block.t_ns, 1
        self._first_ns = self._first_ns if self._count else first_ns
        self._count += count

    def _recovery_sentence(self, lost: int) -> str:
        held = f"{self._count} records over {(self._last_ns - self._first_ns) / 1e9:.1f} s are whole"
        if lost:
            return f"{self.name} is cut short or damaged: {held}, the {lost} bytes after them are lost."
        return f"{self.name} was never closed: its {held}, what may have followed is lost."


def one_by_one(blocks: Iterable[Block]) -> Iterator[Any]:
    """Yield the records of blocks, each register access by itself."""
    for block in blocks:
        yield from block if isinstance(block, Accesses) else (block,)


def _records(reader: StreamReader) -> Iterator[McapRecord]:
    """Yield all records; a chunk is unpacked only if its size is allowed."""
    for record in reader.records:
        if not isinstance(record, Chunk):
            yield record
            continue
        said = frame_content_size(record.data) if record.compression == "zstd" else 0
        if max(record.uncompressed_size, said) > LONGEST_CHUNK:
            raise RecordLengthLimitExceeded(Opcode.CHUNK, record.uncompressed_size, LONGEST_CHUNK)
        yield from breakup_chunk(record, validate_crc=True)


class _SizeLimitedFile:
    """File of `size` bytes that never reads more of them, since a damaged length would take all memory.

    Attributes
    ----------
    at : number of bytes that were read.
    """

    def __init__(self, file: IO[bytes], size: int) -> None:
        self._file, self._size, self.at = file, size, 0

    def read(self, count: int) -> bytes:
        """Return at most `count` bytes; none if a damaged length makes it negative."""
        data = self._file.read(max(0, min(count, self._size - self.at)))
        self.at += len(data)
        return data


def _meta(item: Metadata, path: Path) -> dict[str, Any]:
    try:
        meta = {key: parse_own_json(value) for key, value in item.metadata.items()}
        version = int(meta.pop(VERSION_KEY))
    except (ValueError, KeyError, TypeError) as error:
        raise CaptureError(f"the metadata of {path} are damaged ({error})", "record it again") from error
    if version != VERSION:
        raise CaptureError(
            f"{path} is a capture of version {version}, but this mpucal reads version {VERSION}",
            "read it with the mpucal that recorded it",
        )
    return meta
