"""A chip's accelerometer offset registers as a sink of b_a: written, read back, and verified in the samples.

They hold only b_a, in steps of 1 mg. They are volatile: a power cycle, and the reset at the beginning of a session,
restore the factory trim.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, closing, contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..chip.access import Bus
from ..chip.families import PARTS, part_named
from ..chip.offsets import (
    PLACES,
    OffsetRegisters,
    OffsetResponse,
    Place,
    Words,
    is_as_written,
    measure_offset_response,
    restore,
    shift_words,
    word_difference,
)
from ..chip.port import Port
from ..chip.quick_measure import TemporaryMeasurement, temporary_measurement
from ..chip.setup import read_identity, reset
from ..data import STANDARD_GRAVITY_MPS2, Vector
from ..errors import ChipError
from ..result.calibration import Calibration
from ..result.comparison import is_better
from ..result.correction import THIS_CHIP, other_who_am_i
from ..result.error_model import MG_PER_MPS2, mg_text
from ..result.journal import AT, Journal
from ..session.lay_flat import put_down
from ..sources.chip import OpenedChip
from .kind import Applied, Device, Sink
from .old_state import check_accepted, load_state, not_a_state, nothing_written, restore_on_failure, save_state
from .table import CHIP, CHIP_OFFSETS

FORMAT, REGISTERS = "mpucal.chip_offsets", "registers"

# m/s^2: error of gravity with the calibration of this chip, in any orientation
GRAVITY_MPS2 = 0.2

VOLATILE = (
    "these registers are volatile: after a power cycle or reset the factory trim returns,"
    " and the calibration from before the write applies"
)


@contextmanager
def open_chip(device: Device) -> Iterator[ChipSink]:
    """Open the offset registers of the chip on a bus, after asking the user to put it down.

    Raises
    ------
    BusError : there is no such bus or port, or no chip on it.
    """
    source: OpenedChip = device.open()
    with closing(source.bus):
        put_down(source.listeners, device.say)
        sink = ChipSink(source.bus, f"the chip on {device.name}", Journal.of(CHIP, device.name))
        warning = sink.interruption_warning()
        if warning is not None:
            device.say(warning)
        yield sink


class ChipSink(Sink):
    """Offset registers of the chip on `bus`, which messages call `where`; `journal` notes a write."""

    def __init__(self, bus: Bus, where: str, journal: Journal | None = None) -> None:
        self._journal = journal or Journal()
        self._port = Port(bus)
        self.where = where

    def interruption_warning(self) -> str | None:
        """Return a warning if an earlier write was interrupted and the registers changed; None if not.

        Raises
        ------
        SourceError : the chip cannot be read.
        """
        note = self._journal.interrupted()
        if note is None:
            return None
        if note[REGISTERS] == _hex(self._blocks()):
            self._journal.end()
            return None
        return (
            f"a write to the offset registers of {self.where} was interrupted at {note[AT]}, and their content has"
            " changed: a reset or power cycle restores the factory trim"
        )

    def keep(self, folder: Path) -> tuple[Path, ...]:
        """Save the content of the registers to chip-offsets.json; see Sink."""
        return save_state(CHIP_OFFSETS, folder, FORMAT, self.where, {REGISTERS: _hex(self._blocks())})

    def put_back(self, path: Path) -> str:
        """Restore the registers from the file of an earlier `keep`; see Sink."""
        wanted = saved_blocks(path)
        with nothing_written():
            read_identity(self._port)
            olds = self._blocks()
        with self._restoring(olds):
            for block in wanted:
                if OffsetRegisters.read(self._port, block.place) != block and not block.write(self._port):
                    raise ChipError(f"the chip does not accept {block.data.hex(' ')}", "check that it is the same chip")
        return f"the offset registers of {self.where} have the content of {path.name} again; {VOLATILE}"

    def reason_to_keep(self, calibration: Calibration) -> str | None:
        """See Sink; a bias below a step and its uncertainty cannot be improved."""
        bias, std = (
            float(np.linalg.norm(np.nan_to_num(b))) for b in (calibration.b_a_to_subtract, calibration.b_a_std)
        )
        # half a step of 1 mg is left, rms over three axes
        if is_better(0.5 / MG_PER_MPS2, bias, std):
            return None
        return f"b_a is only {bias:.3f} m/s^2, which the offset registers of {self.where} cannot reduce"

    def write(self, calibration: Calibration) -> Applied:
        """Write b_a to the registers, and verify in the samples that it is removed; see Sink."""
        check_accepted(calibration)
        with nothing_written():
            if "autopilot" in calibration.extra:
                raise ChipError(
                    "the calibration is of an autopilot's stream, not of a chip", "write it to the autopilot"
                )
            likely = self._find_place(calibration)
            olds = self._blocks()
        with self._restoring(olds):
            with temporary_measurement(self._port) as measurement:
                response = measure_offset_response(self._port, measurement, likely)
            reference = self._reference(calibration, response)
            with temporary_measurement(self._port) as measurement:
                applied = self._apply(calibration, response, reference, measurement)
        return Applied(
            replace(calibration, applied_in_hardware=applied),
            (
                f"the offset registers at 0x{response.place[0]:02x} of {self.where} now subtract"
                f" ({mg_text(applied)}) mg, read back and verified in the samples",
                VOLATILE,
            ),
        )

    def _blocks(self) -> tuple[OffsetRegisters, ...]:
        return tuple(OffsetRegisters.read(self._port, place) for place in PLACES)

    def _restoring(self, olds: Sequence[OffsetRegisters]) -> AbstractContextManager[None]:
        def undo() -> None:
            for old in olds:
                restore(self._port, old)

        return restore_on_failure(self._journal, {REGISTERS: _hex(olds)}, undo, "the offset registers")

    def _find_place(self, calibration: Calibration) -> Place:
        """Return the place of the offset registers by the chip's name.

        Raises
        ------
        ChipError : it is not the chip that was calibrated.
        """
        who_am_i = read_identity(self._port)
        calibrated = calibration.sensor
        if how := other_who_am_i(calibrated.who_am_i, who_am_i):
            raise ChipError(how, THIS_CHIP)
        part = part_named((calibrated.chip or "").removesuffix("C")) or PARTS.get(who_am_i)
        return PLACES[0] if part is None else part.family.accel_offset_h

    def _reference(self, calibration: Calibration, response: OffsetResponse) -> Words:
        """Return the content of the registers during the calibration, which they have now or after a reset.

        Raises
        ------
        ChipError : they have another content after a reset, so it is another chip.
        """
        known = calibration.sensor.accel_offsets
        held = OffsetRegisters.read(self._port, response.place).words
        if known is not None and known == held:
            return held
        reset(self._port)
        held = OffsetRegisters.read(self._port, response.place).words
        if known is not None and known != held:
            raise ChipError(
                f"the factory trim of this chip is {held}, but {known} in the one that was calibrated", THIS_CHIP
            )
        return held

    def _apply(
        self, calibration: Calibration, response: OffsetResponse, reference: Words, measurement: TemporaryMeasurement
    ) -> Vector:
        """Write, read back and measure; return (3,) m/s^2 that the registers then subtract."""
        old = OffsetRegisters.read(self._port, response.place)
        counts = calibration.b_a / STANDARD_GRAVITY_MPS2 * response.lsb_per_g
        new = old.with_words(shift_words(reference, -counts))
        before = measurement.rest()
        _check_gravity(calibration, before, subtraction(old.words, reference, response.lsb_per_g))
        if not new.write(self._port):
            raise ChipError("the offset registers do not read back as written", "check the wires, and try again")
        after = measurement.rest()
        expected = -subtraction(new.words, old.words, response.lsb_per_g)
        shift = (after - before) * STANDARD_GRAVITY_MPS2
        check_shift(shift, expected, "put the board on a firm surface, and try again")
        applied = subtraction(new.words, reference, response.lsb_per_g)
        _check_gravity(calibration, after, applied)
        return applied


def _check_gravity(calibration: Calibration, mean_g: Vector, applied_mps2: Vector) -> None:
    """Check that the calibration gives gravity for the mean (3,) at rest, less what the registers subtract (3,)."""
    gravity = calibration.gravity
    a = replace(calibration, applied_in_hardware=applied_mps2).apply(mean_g * STANDARD_GRAVITY_MPS2)
    if not abs(np.linalg.norm(a) - gravity) < GRAVITY_MPS2:
        raise ChipError(
            f"with this calibration |a| of the chip at rest is {np.linalg.norm(a):.2f} m/s², not {gravity:.2f}",
            "lay the board still, and give the calibration of this very chip",
        )


def subtraction(words: Words, reference: Words, lsb_per_g: float) -> Vector:
    """Return (3,) m/s^2 that `words` subtract from the samples more than `reference`; larger words add."""
    return -np.array(word_difference(words, reference)) / lsb_per_g * STANDARD_GRAVITY_MPS2


def _hex(blocks: Sequence[OffsetRegisters]) -> dict[str, str]:
    """Return the content of the registers by their first address, in hexadecimal digits."""
    return {f"0x{block.place[0]:02x}": block.data.hex() for block in blocks}


def saved_blocks(path: Path) -> list[OffsetRegisters]:
    """Return the registers in a file of ChipSink.keep.

    Raises
    ------
    RecordingError : it is not such a file.
    """
    held = load_state(CHIP_OFFSETS, path, FORMAT, REGISTERS)[REGISTERS]
    try:
        registers = {int(first, 0): bytes.fromhex(data) for first, data in held.items()}
    except (ValueError, TypeError, AttributeError) as error:
        raise not_a_state(CHIP_OFFSETS, path, str(error)) from error
    blocks = [OffsetRegisters(place, registers[place[0]]) for place in PLACES if place[0] in registers]
    if not blocks or any(len(block.data) != block.place[2] + 2 - block.place[0] for block in blocks):
        raise not_a_state(CHIP_OFFSETS, path, "some are missing, or too long")
    return blocks


def check_shift(shift: Vector, expected: Vector, remedy: str) -> None:
    """Raise ChipError if samples at rest changed by (3,) m/s^2, other than `expected` of what was written."""
    if not is_as_written(shift / STANDARD_GRAVITY_MPS2, expected / STANDARD_GRAVITY_MPS2):
        raise ChipError(
            f"the samples changed by ({mg_text(shift)}) mg, but ({mg_text(expected)}) mg were written", remedy
        )
