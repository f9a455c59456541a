"""Reader of captures: MCAP files of a chip's register accesses, or a vehicle's packets, and of the session's events.

`capture_writer.py` writes them. It is separate because the library's writer, which no reader needs, takes long to load.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Generator, Iterable, Iterator, Mapping
from pathlib import Path
from typing import IO, Any, NamedTuple, cast

from mcap.exceptions import McapError, RecordLengthLimitExceeded
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk
from zstandard import ZstdError, frame_content_size

from ..arguments import check_regular, reading
from ..chip.access import SessionEvent, Transaction
from ..chip.accesses import Accesses
from ..errors import CaptureError
from ..mavlink.tlog import RawPacket
from ..strict_json import parse_own_json
from .messages import decode_message
from .reading import LONGEST_CHUNK, first_bytes

Record = Transaction | RawPacket | SessionEvent
# unit in which a file holds records: accesses come many at a time
Block = Accesses | RawPacket | SessionEvent

# beginning of every MCAP file, and the head that follows: it ends with the length of the file's profile
MAGIC, _HEAD = b"\x89MCAP0\r\n", struct.Struct("<8xBQI")
FORMAT, VERSION_KEY = "mpucal.capture", "capture_version"
VERSION = 2
# the name of the metadata in a file of calibrated samples, which is not a capture
CALIBRATED = "mpucal.imu"
IMU, ROS1, ROS2 = "sensor_msgs/msg/Imu", b"ros1", b"ros2"

_REMEDY = "give a capture that mpucal recorded, or a bag with sensor_msgs/Imu"

# What a damaged file may raise. The last two come of a length that exceeds all memory.
_DAMAGED_BYTES = (McapError, CRCValidationError, ZstdError, struct.error, UnicodeDecodeError, EOFError)
_DAMAGE = (*_DAMAGED_BYTES, OverflowError, MemoryError)


class Capture(NamedTuple):
    """Content of a capture file.

    Attributes
    ----------
    meta : metadata of `CaptureWriter.start`. records : in order of time.
    recovered : None if the file is whole; else a sentence on what was read of it, and what is lost.
    name : of the file, for messages.
    """

    meta: Mapping[str, Any]
    records: tuple[Record, ...]
    recovered: str | None = None
    name: str = "the capture"


def read_capture(path: str | Path) -> Capture:
    """Read a capture; of a damaged file, the records before the damage.

    Raises
    ------
    CaptureError : the file cannot be read, or is not a capture of mpucal.
    """
    reader = CaptureReader(path)
    records = tuple(reader)
    return Capture(reader.meta, records, reader.recovered, reader.name)


class CaptureReader:
    """Iterator over the records of a capture, once; of a damaged file, over the records before the damage.

    Attributes
    ----------
    name : of the file, for messages. meta : see Capture; known from the first record on.
    recovered : see Capture; known when all records are read.

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
        """Yield the records in blocks, as they are in the file."""
        with reading(self._path, CaptureError), check_regular(self._path).open("rb") as file:
            yield from self._blocks(file)

    def _blocks(self, file: IO[bytes]) -> Iterator[Block]:
        size = os.fstat(file.fileno()).st_size
        self._check(file.read(len(MAGIC)))
        file.seek(0)
        channels: dict[int, Channel] = {}
        headed = False
        whole, finished = 0, False  # number of bytes before any damage, and whether the end was reached
        stream = _SizeLimitedFile(file, size)
        items = _records(
            StreamReader(cast("IO[bytes]", stream), emit_chunks=True, validate_crcs=True, record_size_limit=size)
        )
        while not finished:
            try:
                item = next(items, None)
            except _DAMAGE:
                # What was read so far is whole; `recovered` says what is lost.
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
        if magic != MAGIC:
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


def is_mcap_of_ros(path: Path) -> bool:
    """Return True if an MCAP file is a bag of ROS and not a capture, by its first bytes."""
    begun = first_bytes(path)
    if len(begun) < _HEAD.size or FORMAT.encode() in begun[: _HEAD.size + 100]:
        return False
    return profile(begun) in (ROS1, ROS2) or IMU.encode() in begun


def profile(begun: bytes) -> bytes:
    """Return the profile of an MCAP file by its first bytes."""
    return begun[_HEAD.size :][: _HEAD.unpack_from(begun)[2]] if len(begun) >= _HEAD.size else b""


def one_by_one(blocks: Iterable[Block]) -> Iterator[Any]:
    """Yield the records of blocks, each register access by itself."""
    for block in blocks:
        yield from block if isinstance(block, Accesses) else (block,)


def _records(reader: StreamReader) -> Iterator[McapRecord]:
    """Yield all records, those of chunks too; raise an error for a chunk that would take too much memory."""
    for record in reader.records:
        if not isinstance(record, Chunk):
            yield record
            continue
        size = frame_content_size(record.data) if record.compression == "zstd" else 0
        if max(record.uncompressed_size, size) > LONGEST_CHUNK:
            raise RecordLengthLimitExceeded(Opcode.CHUNK, record.uncompressed_size, LONGEST_CHUNK)
        yield from breakup_chunk(record, validate_crc=True)


class _SizeLimitedFile:
    """File that reads at most its `size` bytes, however many are asked for: a damaged length would take all memory.

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
