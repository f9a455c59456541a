"""A chip's accelerometer offset registers as a sink of b_a: written, read back, and seen in the samples.

Only b_a fits there, in steps of 1 mg; D has no register. They are volatile: what is written is gone with the supply,
and with the reset that a session begins with.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..chip.access import Bus
from ..chip.decode import Decoder
from ..chip.families import PARTS
from ..chip.offset_response import OffsetResponse, measure_offset_response
from ..chip.offsets import PLACES, OffsetRegisters, Place, Words, restore, shift_words, word_difference
from ..chip.port import Port
from ..chip.probe import read_identity
from ..chip.quick_measure import TemporaryMeasurement
from ..chip.setup import reset
from ..data import STANDARD_GRAVITY_MPS2, Vector
from ..errors import ChipError, SourceError, WriteBackError
from ..result.calibration import REFUSED, Calibration
from ..result.comparison import is_better
from ..result.journal import AT, Journal
from ..session.lay_flat import put_down
from ..sources.chip import OpenedChip
from .kept import keep, kept, not_kept
from .kind import Device
from .sink import Applied
from .table import CHIP, CHIP_OFFSETS

FORMAT, REGISTERS = "mpucal.chip_offsets", "registers"

# a calibration that fits the chip brings gravity out within 20 mg, wherever the board lies
GRAVITY_MPS2 = 0.2
# the registers count mg: what half a step is, rms over three axes
STEP_MPS2 = 0.001 * STANDARD_GRAVITY_MPS2 * 0.5
# a measured step: the board lay still, and the accelerometer's own scale is within 3 %
SHIFT_G, SHIFT_SHARE = 0.006, 0.1

VOLATILE = (
    "the registers are volatile: without supply, or after a reset, the factory's trim is back,"
    " and the calibration holds as it was before"
)


@contextmanager
def open_chip(device: Device) -> Iterator[ChipSink]:
    """The offset registers of the chip on a bus, once its person was asked to put it down.

    Raises
    ------
    BusError : no such bus or port, or no chip on it.
    """
    source: OpenedChip = device.open()
    with closing(source.bus):
        put_down(source.listeners, device.say)
        sink = ChipSink(source.bus, f"the chip on {device.name}", Journal.of(CHIP, device.name))
        said = sink.cut_off()
        if said is not None:
            device.say(said)
        yield sink


class ChipSink:
    """The offset registers of the chip on `bus`; `where` says which one, in words, `journal` notes a write."""

    def __init__(self, bus: Bus, where: str, journal: Journal | None = None) -> None:
        self._journal = journal or Journal()
        self._port = Port(bus, Decoder(where))
        self.where = where

    def cut_off(self) -> str | None:
        """What an earlier write that was cut off may have left, in a sentence; None where there was none.

        Raises
        ------
        SourceError : the chip cannot be read.
        """
        left = self._journal.interrupted()
        if left is None:
            return None
        if left[REGISTERS] == _hex(self._blocks()):
            self._journal.end()
            return None
        return (
            f"a write to the offset registers of {self.where} was cut off at {left[AT]}, and they hold something else"
            " than before it: a reset, as with the supply off, brings the factory's trim back"
        )

    def keep(self, folder: Path) -> tuple[Path, ...]:
        """Save what the registers hold to chip-offsets.json; see Sink."""
        return keep(CHIP_OFFSETS, folder, FORMAT, self.where, {REGISTERS: _hex(self._blocks())})

    def put_back(self, path: Path) -> str:
        """Write what an earlier `keep` saved, and say so in a sentence.

        Raises
        ------
        RecordingError : `path` is no such file. WriteBackError : see Sink.
        """
        wanted = kept_blocks(path)
        with _refusing():
            read_identity(self._port)
            olds = self._blocks()
        with self._old_or_new(olds):
            for block in wanted:
                if OffsetRegisters.read(self._port, block.place) != block and not block.write(self._port):
                    raise ChipError(f"the chip does not take {block.data.hex(' ')}", "check that it is the same chip")
        return f"the offset registers of {self.where} hold again what {path.name} says; {VOLATILE}"

    def as_good(self, calibration: Calibration) -> str | None:
        """See Comparing: a bias that is less than a step and its uncertainty is as well left where it is."""
        bias, std = (
            float(np.linalg.norm(np.nan_to_num(b))) for b in (calibration.b_a_to_subtract, calibration.b_a_std)
        )
        if is_better(STEP_MPS2, bias, std):
            return None
        return f"b_a is {bias:.3f} m/s^2, which the offset registers of {self.where} cannot make less"

    def write(self, calibration: Calibration) -> Applied:
        """Write b_a into the registers, and measure that it is gone from the samples; see Sink."""
        with _refusing():
            _check(calibration)
            likely = self._identified(calibration)
            olds = self._blocks()
        with self._old_or_new(olds):
            with TemporaryMeasurement(self._port) as measurement:
                response = measure_offset_response(self._port, measurement, likely)
            reference = self._reference(calibration, response)
            with TemporaryMeasurement(self._port) as measurement:
                applied = self._apply(calibration, response, reference, measurement)
        bias = ", ".join(f"{1000 * value:+.0f}" for value in applied / STANDARD_GRAVITY_MPS2)
        return Applied(
            replace(calibration, applied_in_hardware=applied),
            f"the offset registers at 0x{response.place[0]:02x} of {self.where} now subtract ({bias}) mg,"
            f" read back and seen in the samples; {VOLATILE}",
        )

    def _blocks(self) -> tuple[OffsetRegisters, ...]:
        return tuple(OffsetRegisters.read(self._port, place) for place in PLACES)

    @contextmanager
    def _old_or_new(self, olds: Sequence[OffsetRegisters]) -> Iterator[None]:
        """What fails within leaves the registers as they were."""
        self._journal.begin({REGISTERS: _hex(olds)})
        try:
            yield
        except BaseException as error:
            try:
                for old in olds:
                    restore(self._port, old)
            except SourceError as worse:
                raise WriteBackError(f"{_what(error)}, and then {worse.what}", worse.remedy) from error
            self._journal.end()
            if isinstance(error, SourceError):
                raise WriteBackError(f"{error.what}; the offset registers are as before", error.remedy) from error
            raise
        self._journal.end()

    def _identified(self, calibration: Calibration) -> Place:
        """Where the offset registers are by the chip's name; ChipError where it is another chip than was calibrated."""
        who_am_i = read_identity(self._port)
        calibrated = calibration.sensor
        if calibrated.who_am_i not in (None, who_am_i):
            raise ChipError(
                f"the chip answers 0x{who_am_i:02x} to WHO_AM_I, and the calibrated one 0x{calibrated.who_am_i:02x}",
                "give the calibration of this chip",
            )
        named = {part.chip: part.family.accel_offset_h for part in PARTS.values()}
        by_name = named.get((calibrated.chip or "").removesuffix("C"))
        return by_name or (PARTS[who_am_i].family.accel_offset_h if who_am_i in PARTS else PLACES[0])

    def _reference(self, calibration: Calibration, response: OffsetResponse) -> Words:
        """What the registers held while b_a was measured: what they hold now, or will after a reset.

        Raises
        ------
        ChipError : they hold something else even then: it is another chip.
        """
        known = calibration.sensor.accel_offsets
        held = OffsetRegisters.read(self._port, response.place).words
        if known is not None and known == held:
            return held
        reset(self._port)
        held = OffsetRegisters.read(self._port, response.place).words
        if known is not None and known != held:
            raise ChipError(
                f"the factory's trim of this chip is {held}, and {known} in the one that was calibrated",
                "give the calibration of this chip",
            )
        return held

    def _apply(
        self, calibration: Calibration, response: OffsetResponse, reference: Words, measurement: TemporaryMeasurement
    ) -> Vector:
        """Write, read back, measure; (3,) m/s^2 that the registers then subtract."""
        old = OffsetRegisters.read(self._port, response.place)
        counts = calibration.b_a / STANDARD_GRAVITY_MPS2 * response.lsb_per_g
        new = old.with_words(shift_words(reference, -counts))
        before = measurement.rest()
        _check_gravity(calibration, before, _subtracted(old.words, reference, response))
        if not new.write(self._port):
            raise ChipError("the offset registers read back other than written", "check the wires, and try again")
        after = measurement.rest()
        expected = np.array(word_difference(new.words, old.words)) / response.lsb_per_g
        if (np.abs(after - before - expected) > SHIFT_G + SHIFT_SHARE * np.abs(expected)).any():
            raise ChipError(
                f"the samples moved by ({_mg(after - before)}) mg where ({_mg(expected)}) were written",
                "put the board on a firm surface, and try again",
            )
        applied = _subtracted(new.words, reference, response)
        _check_gravity(calibration, after, applied)
        return applied


def _check(calibration: Calibration) -> None:
    if calibration.quality.get("verdict") == REFUSED or not np.isfinite(calibration.b_a).all():
        raise ChipError("the calibration was refused", "repeat the session as its reasons say")
    if "autopilot" in calibration.extra:
        raise ChipError("the calibration is of an autopilot's stream, not of a chip", "write it to the autopilot")


def _check_gravity(calibration: Calibration, mean_g: Vector, applied_mps2: Vector) -> None:
    """The calibration, with what the registers subtract, makes gravity of what the chip shows at rest."""
    gravity = float(calibration.fit.get("gravity") or STANDARD_GRAVITY_MPS2)
    a = replace(calibration, applied_in_hardware=applied_mps2).apply(mean_g * STANDARD_GRAVITY_MPS2)
    if not abs(np.linalg.norm(a) - gravity) < GRAVITY_MPS2:
        raise ChipError(
            f"with this calibration the chip at rest shows {np.linalg.norm(a):.2f} m/s², not {gravity:.2f}",
            "lay the board still, and give the calibration of this very chip",
        )


def _subtracted(words: Words, reference: Words, response: OffsetResponse) -> Vector:
    """(3,) m/s^2 that `words` take from the samples, other than `reference`; more counts add."""
    return -np.array(word_difference(words, reference)) / response.lsb_per_g * STANDARD_GRAVITY_MPS2


def _hex(blocks: Sequence[OffsetRegisters]) -> dict[str, str]:
    """Registers by their first address, in hexadecimal digits."""
    return {f"0x{block.place[0]:02x}": block.data.hex() for block in blocks}


def kept_blocks(path: Path) -> list[OffsetRegisters]:
    """What `keep` saved."""
    held = kept(CHIP_OFFSETS, path, FORMAT, REGISTERS)[REGISTERS]
    try:
        registers = {int(first, 0): bytes.fromhex(data) for first, data in held.items()}
    except (ValueError, TypeError, AttributeError) as error:
        raise not_kept(CHIP_OFFSETS, path, str(error)) from error
    blocks = [OffsetRegisters(place, registers[place[0]]) for place in PLACES if place[0] in registers]
    if not blocks or any(len(block.data) != block.place[2] + 2 - block.place[0] for block in blocks):
        raise not_kept(CHIP_OFFSETS, path, "some are missing, or too long")
    return blocks


@contextmanager
def _refusing() -> Iterator[None]:
    try:
        yield
    except SourceError as error:
        raise WriteBackError(f"nothing was written: {error.what}", error.remedy) from error


def _what(error: BaseException) -> str:
    return error.what if isinstance(error, SourceError) else "the write was interrupted"


def _mg(values_g: Vector) -> str:
    return ", ".join(f"{1000 * value:+.0f}" for value in values_g)
