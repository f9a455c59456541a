"""The memory of a serial bridge as a sink: the config blob is stored, read back, and validated by the firmware."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from pkgutil import resolve_name

from ..disk.atomic import write_atomically
from ..errors import BusError, WriteBackError
from ..result.blob import Blob, BlobError
from ..result.calibration import Calibration
from ..result.comparison import is_better, worst_magnitude_error
from ..result.correction import THIS_CHIP, other_who_am_i
from ..sinks.kind import Applied, Device, Sink
from ..sinks.old_state import check_accepted, nothing_written
from ..sinks.table import BRIDGE_BLOB
from .store import BlobStore, StoredBlob


@contextmanager
def open_bridge(device: Device) -> Iterator[BridgeSink]:
    """Open the memory of the bridge on a port.

    Raises
    ------
    BusError : there is no such port, no bridge on it, or the bridge has no memory.
    """
    with resolve_name(device.kind.store)(device.values) as store:
        yield BridgeSink(store)


class BridgeSink(Sink):
    """Config blob in the memory of the bridge behind `store`."""

    def __init__(self, store: BlobStore) -> None:
        self._store = store
        self.where = f"the bridge on {store.name}"

    def keep(self, folder: Path) -> tuple[Path, ...]:
        """Save the old blob to bridge-blob-N.bin, N being its number; `mpucal write` restores it. See Sink."""
        held = self._store.read()
        if held is None:
            return ()
        path = folder / BRIDGE_BLOB.name.replace("N", str(held.generation))
        write_atomically(path, held.data)
        return (path,)

    def reason_to_keep(self, calibration: Calibration) -> str | None:
        """See Sink; an empty or damaged memory is never as good, but other data may be needed."""
        if self._store.occupied:
            return (
                f"the memory of {self.where} holds other data, perhaps another sketch's or file system's, which a write"
                " overwrites (MPUCAL_EEPROM_AT in the sketch chooses another place)"
            )
        held = self._store.read()
        try:
            old = None if held is None else Calibration.from_blob(Blob.decode(held.data))
        except BlobError:
            return None
        if old is None or is_better(0.0, worst_magnitude_error(calibration, old.D, old.b_a), calibration.magnitude_std):
            return None
        return f"the calibration in {self.where} is predicted to be as good"

    def write(self, calibration: Calibration) -> Applied:
        """Store the blob, read it back, compare, and have the firmware validate it; see Sink."""
        new = _encode(calibration)
        with nothing_written():
            if how := other_who_am_i(calibration.sensor.who_am_i, self._store.who_am_i()):
                raise WriteBackError(f"nothing was written to {self.where}: {how}", THIS_CHIP)
            old = self._store.read()
        try:
            if self._store.occupied:
                self._store.erase()
                self._store.greet()
            self._store.write(new)
            held = self._store.read()
        except (BusError, KeyboardInterrupt) as error:
            failure = error if isinstance(error, BusError) else BusError("the write was interrupted", "start again")
            held = self._read_after(failure, old, new)
        if held is None or held.data != new:
            raise self._restore(old)
        return Applied(
            calibration,
            (
                f"{self.where} keeps it as its blob number {held.generation} ({len(new)} bytes,"
                f" CRC-32 {held.crc:08x}), read back and validated by its firmware",
            ),
        )

    def _read_after(self, error: BusError, old: StoredBlob | None, new: bytes) -> StoredBlob:
        """Return the content of the memory after `error` if it is the new blob.

        Raises
        ------
        WriteBackError : it is the old one, or cannot be read.
        """
        try:
            self._store.greet()
            held = self._store.read()
        except BusError as gone:
            raise WriteBackError(
                f"{error.what}; it has either the old calibration or the new one, whole",
                f"connect it again, and check which with mpucal show --serial {self._store.name}",
            ) from gone
        if held is None or held.data != new:
            holds = "it still has the old calibration" if old else "it still has none"
            raise WriteBackError(f"{error.what}; {holds}", error.remedy) from error
        return held

    def _restore(self, old: StoredBlob | None) -> WriteBackError:
        """Restore the old blob after a wrong read-back; return the error to raise."""
        with suppress(BusError):
            if old is None:
                self._store.erase()
            else:
                self._store.write(old.data)
            held = self._store.read()
            if (held and held.data) == (old and old.data):
                holds = "the old calibration is restored" if old else "it has none, as before"
                return WriteBackError(f"{self.where} does not read back what was stored; {holds}", "try again")
        return WriteBackError(
            f"{self.where} does not read back what was stored, and does not accept the old calibration",
            "use another board: its memory is worn out",
        )


def _encode(calibration: Calibration) -> bytes:
    # a blob has no verdict, so a refused calibration must not become one
    check_accepted(calibration)
    try:
        return calibration.blob().encode()
    except BlobError as error:
        raise WriteBackError(
            f"nothing was written: the calibration does not fit into a blob ({error})", "calibrate again"
        ) from error
