"""Blob messages of an emulated bridge."""

from __future__ import annotations

from ...result.blob import MAX_LENGTH
from ...sources.bridge import messages as wire
from ...sources.bridge.messages import Message, Reply, Status
from .storage import Memory, SlotStorage, crc_of, is_valid_blob


class BlobHandler:
    """Handler of the blob messages of firmware_protocol.md, on a memory."""

    def __init__(self, memory: Memory) -> None:
        self._storage = SlotStorage(memory)
        self._length: int | None = None
        self._arrived = 0

    @property
    def occupied(self) -> bool:
        """True if the memory holds bytes that are not a blob's."""
        return self._storage.occupied

    def discard(self) -> None:
        """Drop a blob that was begun and not committed."""
        self._length = None

    def answer(self, request: Message, t_us: int) -> Reply:
        """Return the reply to one of them."""
        match request:
            case wire.BlobState():
                return self._state(t_us)
            case wire.BlobRead():
                return self._read(request, t_us)
            case wire.BlobBegin():
                return wire.BlobBeginReply(self._begin(request), t_us)
            case wire.BlobData():
                return wire.BlobDataReply(self._data(request), t_us)
            case wire.BlobCommit():
                return self._commit(request, t_us)
            case wire.BlobErase():
                self._storage.erase()
                self._length = None
                return wire.BlobEraseReply(Status.OK, t_us)
        return Reply(Status.UNKNOWN_TYPE, t_us)

    def _state(self, t_us: int) -> Reply:
        stored = self._storage.stored()
        if stored is None:
            return wire.BlobStateReply(Status.NO_BLOB, t_us, 0, 0, 0)
        return wire.BlobStateReply(Status.OK, t_us, stored.generation, len(stored.blob), crc_of(stored.blob))

    def _read(self, request: wire.BlobRead, t_us: int) -> Reply:
        if not 1 <= request.count <= wire.MAX_READ:
            return Reply(Status.BAD_PAYLOAD, t_us)
        stored = self._storage.stored()
        if stored is None:
            return Reply(Status.NO_BLOB, t_us)
        if request.offset + request.count > len(stored.blob):
            return Reply(Status.BAD_OFFSET, t_us)
        return wire.BlobReadReply(Status.OK, t_us, stored.blob[request.offset : request.offset + request.count])

    def _begin(self, request: wire.BlobBegin) -> Status:
        if request.length > MAX_LENGTH:
            return Status.NO_ROOM
        if self._storage.occupied:
            return Status.OCCUPIED
        self._storage.begin()
        self._length, self._arrived = request.length, 0
        return Status.OK

    def _data(self, request: wire.BlobData) -> Status:
        if not 1 <= len(request.data) <= wire.MAX_CHUNK:
            return Status.BAD_PAYLOAD
        if self._length is None:
            return Status.NOT_BEGUN
        end = request.offset + len(request.data)
        if request.offset > self._arrived or end > self._length:
            return Status.BAD_OFFSET
        self._storage.write(request.offset, request.data)
        self._arrived = max(self._arrived, end)
        return Status.OK

    def _commit(self, request: wire.BlobCommit, t_us: int) -> Reply:
        if self._length is None:
            return self._repeated(request, t_us)
        if self._arrived != self._length or request.length != self._length:
            return Reply(Status.BAD_OFFSET, t_us)
        blob = self._storage.written(self._length)
        if not is_valid_blob(blob) or crc_of(blob) != request.crc:
            return Reply(Status.BAD_BLOB, t_us)
        self._length = None
        return wire.BlobCommitReply(Status.OK, t_us, self._storage.commit())

    def _repeated(self, request: wire.BlobCommit, t_us: int) -> Reply:
        stored = self._storage.stored()
        if stored is None or (len(stored.blob), crc_of(stored.blob)) != (request.length, request.crc):
            return Reply(Status.NOT_BEGUN, t_us)
        return wire.BlobCommitReply(Status.OK, t_us, stored.generation)
