"""Writer of MCAP files with one channel of messages of constant size, a chunk at once.

mcap's own writer takes 20 us per message; here an array is a chunk. The records are those of the mcap library
(https://mcap.dev/spec), except the frequent ones: Message and MessageIndex.
"""

from __future__ import annotations

import zlib
from typing import IO, Any

import numpy as np
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray
from zstandard import ZstdCompressor

# opcode and length of a record
RECORD_HEAD = 9
# per chunk: 1 MB if a message takes 350 bytes
MESSAGES = 3072


class ChunkWriter:
    """Writer of an MCAP file from its beginning.

    Parameters
    ----------
    message : dtype of a message. head : the file's first record. schema, channel, metadata : of the messages.
    """

    def __init__(
        self,
        file: IO[bytes],
        message: np.dtype[Any],
        head: Header,
        schema: Schema,
        channel: Channel,
        metadata: Metadata,
    ) -> None:
        self._file, self._schema, self._channel, self._metadata = file, schema, channel, metadata
        fields = [("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4")]
        self._row = np.dtype([*fields, ("log_time", "<u8"), ("publish_time", "<u8"), ("data", message)])
        self._compressor = ZstdCompressor()
        self._count = 0
        self._first_ns = self._last_ns = 0
        self._chunks: list[ChunkIndex] = []
        self._file.write(MCAP0_MAGIC)
        self._put(head)
        self._metadata_at = self._put(metadata)
        self._put(schema)
        self._put(channel)

    def add(self, t_ns: NDArray[np.int64], messages: NDArray[Any]) -> None:
        """Write messages (n,) with times `t_ns` (n,)."""
        for first in range(0, len(t_ns), MESSAGES):
            self._chunk(t_ns[first : first + MESSAGES], messages[first : first + MESSAGES])

    def finish(self) -> None:
        """Write the summary."""
        self._put(DataEnd(data_section_crc=0))
        summary = RecordBuilder()
        for record in (self._schema, self._channel, self._statistics(), *self._chunks, self._metadata_index()):
            record.write(summary)
        start, data = self._file.tell(), summary.end()
        self._file.write(data)
        # 0 means no CRC
        self._put(Footer(summary_start=start, summary_offset_start=0, summary_crc=0))
        self._file.write(MCAP0_MAGIC)

    def _chunk(self, t_ns: NDArray[np.int64], messages: NDArray[Any]) -> None:
        rows = np.empty(len(t_ns), self._row)
        rows["opcode"], rows["length"] = Opcode.MESSAGE, self._row.itemsize - RECORD_HEAD
        rows["channel"], rows["sequence"] = self._channel.id, np.arange(self._count, self._count + len(rows))
        rows["log_time"] = rows["publish_time"] = t_ns
        rows["data"] = messages
        data = rows.tobytes()
        begin, end = int(t_ns.min()), int(t_ns.max())
        compressed = self._compressor.compress(data)
        at = self._file.tell()
        self._put(Chunk("zstd", compressed, end, begin, zlib.crc32(data), len(data)))
        index_at = self._file.tell()
        self._index(t_ns)
        self._chunks.append(
            ChunkIndex(
                chunk_length=index_at - at,
                chunk_start_offset=at,
                compression="zstd",
                compressed_size=len(compressed),
                message_end_time=end,
                message_index_length=self._file.tell() - index_at,
                message_index_offsets={self._channel.id: index_at},
                message_start_time=begin,
                uncompressed_size=len(data),
            )
        )
        self._first_ns = min(begin, self._first_ns) if self._count else begin
        self._last_ns = max(end, self._last_ns)
        self._count += len(rows)

    def _index(self, t_ns: NDArray[np.int64]) -> None:
        """Write a MessageIndex: the time of each message and its offset in the chunk."""
        entries = np.empty(len(t_ns), [("time", "<u8"), ("offset", "<u8")])
        entries["time"], entries["offset"] = t_ns, np.arange(len(t_ns)) * self._row.itemsize
        builder = RecordBuilder()
        builder.start_record(Opcode.MESSAGE_INDEX)
        builder.write2(self._channel.id)
        builder.write4(entries.nbytes)
        builder.write(entries.tobytes())
        builder.finish_record()
        self._file.write(builder.end())

    def _put(self, record: Any) -> int:
        """Write a record and return its offset."""
        at = self._file.tell()
        builder = RecordBuilder()
        record.write(builder)
        self._file.write(builder.end())
        return at

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=0,
            channel_count=1,
            channel_message_counts={self._channel.id: self._count},
            chunk_count=len(self._chunks),
            message_count=self._count,
            message_end_time=self._last_ns,
            message_start_time=self._first_ns,
            metadata_count=1,
            schema_count=1,
        )

    def _metadata_index(self) -> MetadataIndex:
        builder = RecordBuilder()
        self._metadata.write(builder)
        return MetadataIndex(self._metadata_at, builder.count, self._metadata.name)
