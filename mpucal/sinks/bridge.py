"""The memory of a serial bridge as a sink: the config blob stored, read back, and found valid by its firmware."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from pkgutil import resolve_name

from ..disk.whole import write_atomically
from ..errors import BusError, WriteBackError
from ..result.blob import Blob, BlobError
from ..result.calibration import REFUSED, Calibration
from ..result.comparison import is_better, worst_magnitude_error
from ..sources.bridge.store import BlobStore, StoredBlob
from .kind import Device
from .sink import Applied
from .table import BRIDGE_BLOB

UNTOUCHED = "nothing was written"


@contextmanager
def open_bridge(device: Device) -> Iterator[BridgeSink]:
    """The memory of the bridge on a port.

    Raises
    ------
    BusError : no such port, no bridge on it, or one that keeps nothing.
    """
    with resolve_name(device.kind.store)(device.values) as store:
        if store.occupied:
            device.say(
                f"the memory of the bridge on {store.name} holds what is no calibration, perhaps another sketch's;"
                " storing one overwrites it (MPUCAL_EEPROM_AT in the sketch chooses another place)"
            )
        yield BridgeSink(store)


class BridgeSink:
    """The config blob that the bridge behind `store` keeps for the firmware that uses it."""

    def __init__(self, store: BlobStore) -> None:
        self._store = store
        self.where = f"the bridge on {store.name}"

    def keep(self, folder: Path) -> tuple[Path, ...]:
        """Save the old blob to bridge-blob-N.bin, N its number; `mpucal write` takes it like any other. See Sink."""
        held, old = self._store.state(), self._store.read()
        if held is None or old is None:
            return ()
        path = folder / BRIDGE_BLOB.name.replace("N", str(held.generation))
        write_atomically(path, old)
        return (path,)

    def as_good(self, calibration: Calibration) -> str | None:
        """See Comparing; a memory that holds no calibration, or a damaged one, is never as good."""
        held = self._store.read()
        try:
            old = None if held is None else Calibration.from_blob(Blob.decode(held))
        except BlobError:
            return None
        if old is None or is_better(0.0, worst_magnitude_error(calibration, old.D, old.b_a), calibration.magnitude_std):
            return None
        return f"the calibration that {self.where} keeps is predicted to be as good"

    def write(self, calibration: Calibration) -> Applied:
        """Store the blob, read it back, compare, and ask the firmware whether it is valid; see Sink."""
        new = self._blob(calibration)
        try:
            self._check_chip(calibration)
            old = self._store.read()
        except BusError as error:
            raise WriteBackError(f"{error.what}; {UNTOUCHED}", error.remedy) from error
        try:
            self._store.write(new)
            read_back, held = self._store.read(), self._store.state()
        except (BusError, KeyboardInterrupt) as error:
            failure = error if isinstance(error, BusError) else BusError("the write was interrupted", "start again")
            read_back, held = self._after(failure, old, new)
        if read_back != new or held is None:
            raise self._restored(old)
        return Applied(
            calibration,
            f"{self.where} keeps it as its blob number {held.generation} ({len(new)} bytes, CRC-32 {held.crc:08x}),"
            " read back the same, and found valid by its firmware",
        )

    def _blob(self, calibration: Calibration) -> bytes:
        # a blob says nothing of its quality: what was refused has none
        if calibration.quality.get("verdict") == REFUSED:
            raise WriteBackError(f"the calibration was refused; {UNTOUCHED}", "measure again, as its reasons say")
        try:
            return calibration.blob().encode()
        except BlobError as error:
            raise WriteBackError(
                f"the calibration does not fit a blob ({error}); {UNTOUCHED}", "measure again"
            ) from error

    def _check_chip(self, calibration: Calibration) -> None:
        answer, calibrated = self._store.who_am_i(), calibration.sensor.who_am_i
        if None not in (answer, calibrated) and answer != calibrated:
            raise WriteBackError(
                f"the chip of {self.where} answers 0x{answer:02x} to WHO_AM_I, and the calibrated one"
                f" 0x{calibrated:02x}; {UNTOUCHED}",
                "give the calibration of this chip",
            )

    def _after(self, error: BusError, old: bytes | None, new: bytes) -> tuple[bytes, StoredBlob | None]:
        """What the bridge holds after `error`, where that is the new blob.

        Raises
        ------
        WriteBackError : it holds the old one, or does not tell.
        """
        try:
            self._store.greet()
            blob, held = self._store.read(), self._store.state()
        except BusError as gone:
            raise WriteBackError(
                f"{error.what}; it keeps the old calibration or the new one, never a part",
                f"plug it in again, then see which: mpucal show --serial {self._store.name}",
            ) from gone
        if blob != new:
            holds = "it keeps the old calibration" if old else "it keeps none, as before"
            raise WriteBackError(f"{error.what}; {holds}", error.remedy) from error
        return blob, held

    def _restored(self, old: bytes | None) -> WriteBackError:
        """What to say of a memory that gives back something else."""
        with suppress(BusError):
            if old is None:
                self._store.erase()
            else:
                self._store.write(old)
            if self._store.read() == old:
                holds = "the old calibration is there again" if old else "it keeps none, as before"
                return WriteBackError(
                    f"{self.where} gives back another calibration than was stored; {holds}", "try again"
                )
        return WriteBackError(
            f"{self.where} gives back another calibration than was stored, and does not take the old one",
            "use another board: its memory is worn out",
        )
