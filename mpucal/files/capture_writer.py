"""Writer of captures as MCAP files.

While a capture is written, a chunk with one message of register accesses holds half a second. A closed capture is
rewritten with longer chunks, which take half the space and are read several times as fast: each is a tenth of the part
before it, so that little is lost if the file is cut.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, Self, cast

from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import CompressionType, IndexType, Writer
from zstandard import ZstdError

from ..chip.access import SessionEvent, Transaction
from ..chip.accesses import Accesses
from ..disk.atomic import atomic_file
from ..disk.growing_file import GrowingFile
from ..errors import CaptureError, OutputError
from ..mavlink.tlog import RawPacket
from .mcap import FORMAT, VERSION, VERSION_KEY, CaptureReader, Record
from .messages import BUS, PACKETS, SESSION, accesses_schema, encode_accesses, encode_event, event_schema

# half of the second that a killed program may lose; the other half may pass between two records
CHUNK_NS = 500_000_000
# chunks of a closed capture: the longest, and the inverse share of the part before it
CLOSED_CHUNK_NS, CLOSED_CHUNK_PART = 10_000_000_000, 10

# errors of writing; ZstdError: out of memory
_FAILED = (OSError, ZstdError)


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
        if isinstance(record, Accesses):
            begin_ns, t_ns = int(record.t_ns[0]), int(record.t_ns[-1])
        else:
            begin_ns = t_ns = record.t_ns
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
