"""The config blob that a bridge keeps: read it, replace it, ask whether it is valid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

from ...chip.registers import WHO_AM_I
from ...errors import BusError, KeepsNothing
from ...result.blob import Blob, BlobError
from .link import Link
from .link_errors import not_readable, refused, without_blob
from .messages import (
    MAX_CHUNK,
    MAX_READ,
    BlobBegin,
    BlobCommit,
    BlobCommitReply,
    BlobData,
    BlobErase,
    BlobRead,
    BlobReadReply,
    BlobState,
    BlobStateReply,
    Feature,
    Message,
    Read,
    ReadReply,
    Reply,
    Status,
)

R = TypeVar("R", bound=Reply)
CRC_BYTES = 4


@dataclass(frozen=True)
class StoredBlob:
    """What the bridge says of the blob that it holds and found valid just now."""

    generation: int
    length: int
    crc: int


class BlobStore:
    """The memory of the bridge behind `link`, which was greeted.

    Every method raises BusError where the bridge is lost, cannot do it, or keeps no blobs.
    """

    def __init__(self, link: Link) -> None:
        self._link = link

    @property
    def name(self) -> str:
        """The bridge's port."""
        return self._link.port.name

    @property
    def occupied(self) -> bool:
        """Whether storing overwrites what somebody else keeps there."""
        return bool(self._link.bridge.features & Feature.OCCUPIED)

    def greet(self) -> None:
        """Greet the bridge again, after it was lost; what it was being sent is given up."""
        self._link.greet(self._link.bridge.address)

    def who_am_i(self) -> int | None:
        """What the chip of the bridge answers to WHO_AM_I; None: it finds none."""
        if not self._link.bridge.address:
            return None
        (reply,) = self._done(ReadReply, Read(WHO_AM_I, 1))
        return reply.data[0]

    def state(self) -> StoredBlob | None:
        """The valid blob that it holds; None: none."""
        self._check()
        reply = self._link.ask(BlobState())[0][-1].reply
        if reply.status == Status.NO_BLOB:
            return None
        said = self._expect(reply, BlobStateReply)
        return StoredBlob(said.generation, said.length, said.crc)

    def read(self) -> bytes | None:
        """The blob's bytes; None: it holds none."""
        held = self.state()
        if held is None:
            return None
        requests = [BlobRead(at, min(MAX_READ, held.length - at)) for at in range(0, held.length, MAX_READ)]
        return b"".join(reply.data for reply in self._done(BlobReadReply, *requests))

    def take(self) -> tuple[int, bytes]:
        """The blob's number and bytes.

        Raises
        ------
        BusError : it holds none, or what it gives is no blob.
        """
        held, blob = self.state(), self.read()
        if held is None or blob is None:
            raise BusError(*refused(self.name, Status.NO_BLOB))
        try:
            Blob.decode(blob)
        except BlobError as error:
            raise BusError(*not_readable(self.name, str(error))) from error
        return held.generation, blob

    def write(self, blob: bytes) -> StoredBlob:
        """Replace what it holds by `blob`, or change nothing; returns what the bridge then says that it holds.

        The old one stays valid until the bridge has checked the new one.
        """
        self._check()
        chunks = [BlobData(at, blob[at : at + MAX_CHUNK]) for at in range(0, len(blob), MAX_CHUNK)]
        crc = int.from_bytes(blob[-CRC_BYTES:], "little")
        self._done(Reply, BlobBegin(len(blob)))
        for chunk in chunks:
            self._done(Reply, chunk)
        (reply,) = self._done(BlobCommitReply, BlobCommit(len(blob), crc))
        return StoredBlob(reply.generation, len(blob), crc)

    def erase(self) -> None:
        """Hold none."""
        self._check()
        self._done(Reply, BlobErase())

    def _check(self) -> None:
        if not self._link.bridge.features & Feature.BLOB:
            raise KeepsNothing(*without_blob(self.name))

    def _done(self, kind: type[R], *requests: Message) -> list[R]:
        return [self._expect(answers[-1].reply, kind) for answers in self._link.ask(*requests)]

    def _expect(self, reply: Reply, kind: type[R]) -> R:
        if reply.status != Status.OK or not isinstance(reply, kind):
            raise BusError(*refused(self.name, reply.status))
        return reply
