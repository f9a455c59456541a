"""Config blob that a bridge stores: read, replace and check it."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

from ..chip.registers import WHO_AM_I
from ..errors import BusError, NoStorage
from ..result.blob import CHECKSUM, Blob, BlobError
from . import messages as wire
from .link import Link
from .port_errors import request_failed

R = TypeVar("R", bound=wire.Reply)


class StoredBlob(NamedTuple):
    """Blob that the bridge stores and has just checked, with its number."""

    generation: int
    data: bytes

    @property
    def crc(self) -> int:
        """CRC-32 at its end."""
        return _crc(self.data)


class BlobStore:
    """Memory of the bridge behind `link`, which was greeted.

    Every method raises BusError if the bridge is lost, cannot do it, or stores no blobs.
    """

    def __init__(self, link: Link) -> None:
        self._link = link

    @property
    def name(self) -> str:
        """Name of the bridge's port."""
        return self._link.port.name

    @property
    def occupied(self) -> bool:
        """True if the memory holds other data, which `erase` gives up; until then a write is refused."""
        return bool(self._link.bridge.features & wire.Feature.OCCUPIED)

    def greet(self) -> None:
        """Greet the bridge again after it was lost; a write that was in progress is abandoned."""
        self._link.greet(self._link.bridge.address)

    def who_am_i(self) -> int | None:
        """Return the answer of the bridge's chip to WHO_AM_I; None without a chip."""
        if not self._link.bridge.address:
            return None
        (reply,) = self._ask(wire.ReadReply, wire.Read(WHO_AM_I, 1))
        return reply.data[0]

    def read(self) -> StoredBlob | None:
        """Read the valid blob; None without one."""
        self._check_feature()
        reply = self._link.ask(wire.BlobState())[0][-1].reply
        if reply.status == wire.Status.NO_BLOB:
            return None
        state = self._expect(reply, wire.BlobStateReply)
        length, step = state.length, wire.MAX_READ
        requests = [wire.BlobRead(at, min(step, length - at)) for at in range(0, length, step)]
        parts = self._ask(wire.BlobReadReply, *requests)
        return StoredBlob(state.generation, b"".join(part.data for part in parts))

    def take(self) -> StoredBlob:
        """Read the blob, and check it.

        Raises
        ------
        BusError : no blob is stored, or it is not valid.
        """
        stored = self.read()
        if stored is None:
            raise BusError(*request_failed(self.name, wire.Status.NO_BLOB))
        try:
            Blob.decode(stored.data)
        except BlobError as error:
            what = f"the data that the bridge on {self.name} stores is not a calibration ({error})"
            raise BusError(what, "store one again") from error
        return stored

    def write(self, blob: bytes) -> None:
        """Replace the stored blob, which stays valid until the bridge has checked the new one, or change nothing."""
        self._check_feature()
        self._ask(wire.Reply, wire.BlobBegin(len(blob)))
        for at in range(0, len(blob), wire.MAX_CHUNK):
            self._ask(wire.Reply, wire.BlobData(at, blob[at : at + wire.MAX_CHUNK]))
        self._ask(wire.Reply, wire.BlobCommit(len(blob), _crc(blob)))

    def erase(self) -> None:
        """Erase the stored blob, and other data in its place."""
        self._check_feature()
        self._ask(wire.Reply, wire.BlobErase())

    def _check_feature(self) -> None:
        if not self._link.bridge.features & wire.Feature.BLOB:
            raise NoStorage(
                f"the bridge on {self.name} cannot store a calibration",
                "keep calibration.bin where its firmware reads it",
            )

    def _ask(self, kind: type[R], *requests: wire.Message) -> list[R]:
        return [self._expect(answers[-1].reply, kind) for answers in self._link.ask(*requests)]

    def _expect(self, reply: wire.Reply, kind: type[R]) -> R:
        if reply.status != wire.Status.OK or not isinstance(reply, kind):
            raise BusError(*request_failed(self.name, reply.status))
        return reply


def _crc(blob: bytes) -> int:
    return int.from_bytes(blob[-CHECKSUM.size :], "little")
