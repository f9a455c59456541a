"""Examination of a chip on any bus, step by step.

The offset registers are restored afterwards: identifying the chip resets it, which reloads the factory's trim, and a
correction that had been written there would be lost.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, suppress
from typing import Any

import numpy as np

from ..chip.access import Bus
from ..chip.config import MOST_POLLED_HZ, Config
from ..chip.driver import NO_FIFO, Driver
from ..chip.families import PARTS, Family, Part
from ..chip.identity import describe_mismatch
from ..chip.losses import Loss, TransferStats, remedy_of
from ..chip.offsets import PLACES, OffsetRegisters, OffsetResponse, measure_offset_response, restore
from ..chip.port import TRIES, Port
from ..chip.quick_measure import PATIENCE, run_self_test, temporary_measurement
from ..chip.setup import read_identity
from ..data import Sensor
from ..errors import BoardMoved, ChipError, ChipReset, SourceError, UnknownOffsets
from ..session.ports import measured
from ..sources.chip import OpenedChip
from .dead_axes import DEAD_AXIS, REPLACE, STUCK_BITS, examine_bits
from .finding import Finding, Mark
from .measure import examine_speed, examine_stream

# Shares of failed transfers: above the first a session is in danger, above the second nothing works.
MANY_FAILED, MOST_FAILED = 0.05, 0.5
# Share of the factory's response to the self test below which an axis is dead.
LEAST_RESPONSE = 0.05
MOVED = "the board moved"


def examine(
    bus: Bus, config: Config, seconds: float, examine_bus: Callable[[Any], Iterable[Finding]] = examine_speed
) -> Iterator[Finding]:
    """Examine a chip, and the bus that leads to it; end early if the chip does not answer.

    Parameters
    ----------
    seconds : time to observe its samples; the board is to lie still. examine_bus : yields the findings about the bus.
    """
    stats = TransferStats()
    port = Port(bus, stats=stats)
    # Fewer attempts to measure at rest follow, if a board is not put down in the first wait.
    patience = TRIES
    try:
        # Nothing is written to a chip that is not known.
        read_identity(port)
        olds = [OffsetRegisters.read(port, place) for place in PLACES]
        yield from examine_bus(bus)
        with suppress(ChipError), temporary_measurement(port) as measurement:
            # Wait until the board is put down. If it is not, a later step reports it.
            measurement.rest()
            patience = PATIENCE
    except SourceError as error:
        yield from _transfers(stats)
        yield Finding.failed("chip", error)
        return
    driver = Driver(bus, config, "doctor", stats=stats)
    try:
        yield from _examine_chip(port, driver, config, seconds, olds, patience)
    except SourceError as error:
        yield from _transfers(stats)
        yield Finding.failed("broken off", error)
    else:
        yield from _transfers(stats, always=True)
    finally:
        driver.stop()
        with suppress(SourceError):
            for old in olds:
                restore(port, old)


def _transfers(stats: TransferStats, always: bool = False) -> Iterator[Finding]:
    """Report the failed transfers; unless `always`, not for a bus on which nothing failed, or nothing worked."""
    data = {"transfers": stats.transfers, "retries": stats.retries, "errors": dict(stats.errors)}
    if always or (stats.errors and stats.error_share < MOST_FAILED):
        mark = Mark.BAD if stats.error_share > MANY_FAILED else Mark.NOTE
        yield Finding.check("transfers", not stats.errors, str(stats), remedy_of(stats.errors), data, mark)


def _examine_chip(
    port: Port, driver: Driver, config: Config, seconds: float, olds: list[OffsetRegisters], patience: int
) -> Iterator[Finding]:
    sensor = driver.start()
    part, family = driver.settings.part, driver.settings.part.family
    mismatch = describe_mismatch(sensor)
    data = {"chip": sensor.chip, "who_am_i": sensor.who_am_i, "accel_range_g": sensor.accel_range_g}
    what = mismatch or f"{sensor.chip}, WHO_AM_I 0x{sensor.who_am_i or 0:02x}"
    yield Finding.check("chip", mismatch is None, what, "", data)
    if not part.fifo_bytes:
        yield Finding("FIFO", Mark.NOTE, NO_FIFO, f"take --rate {MOST_POLLED_HZ} or less, and a bus of 400 kHz")
    yield _factory_trim(port, family, olds)
    recording = measured(driver, seconds)
    if len(recording) > config.rate_hz:
        yield from examine_stream(recording, config.rate_hz, seconds, family, remedy_of(driver.faults))
    else:
        yield Finding(
            "stream", Mark.BAD, f"{len(recording)} samples in {seconds:g} s", "check the wires and the supply"
        )
    for loss, times in driver.faults.items():
        yield Finding("gaps", Mark.BAD, f"{times} × {loss.what}", loss.remedy, {"fault": loss, "times": times})
    if driver.repaired:
        what = f"{driver.repaired} of {len(recording)} samples had a bit flipped on the bus, and were set right"
        data = {"flipped": driver.repaired, "samples": len(recording)}
        yield Finding("bit errors", Mark.BAD, what, Loss.FLIPPED.remedy, data)
    driver.stop()
    by_who_am_i = PARTS.get(sensor.who_am_i or 0)
    consistent = by_who_am_i is not None and by_who_am_i.family.name == family.name
    doubts = [] if consistent else ["WHO_AM_I and behaviour disagree"]
    for finding, doubt in (_self_test(port, part), *_offsets_and_bits(port, part, patience)):
        yield finding
        doubts += doubt
    yield _verdict(sensor, doubts)


def _factory_trim(port: Port, family: Family, olds: list[OffsetRegisters]) -> Finding:
    old = next(block for block in olds if block.place == family.accel_offset_h)
    trim = OffsetRegisters.read(port, old.place).words
    data = {"held": list(old.words), "trim": list(trim), "place": old.place[0]}
    what = f"{', '.join(map(str, trim))} at 0x{old.place[0]:02x}"
    kept = old.words == trim
    what += "" if kept else f"; replaced by {', '.join(map(str, old.words))}"
    remedy = "restored after this examination; a session resets the chip and measures with the factory trim"
    return Finding.check("factory trim", kept, what, remedy, data)


def _self_test(port: Port, part: Part) -> tuple[Finding, list[str]]:
    test = run_self_test(port, part)
    shares = {"accelerometer": test.accel_shares.tolist(), "gyroscope": test.gyro_shares.tolist()}
    accel, gyro = ([share if np.isfinite(share) else None for share in each] for each in shares.values())
    data = {"accel_shares": accel, "gyro_shares": gyro}
    if test.moved:
        return Finding("self test", Mark.UNKNOWN, MOVED, "put it on a firm surface and try again", data), [MOVED]
    if not test.has_codes:
        what = "the chip has no factory codes to compare with"
        return Finding("self test", Mark.NOTE, what, "", data), ["it has no self-test codes"]
    percent = (f"{name} {', '.join(f'{100 * share:.0f}' for share in each)} %" for name, each in shares.items())
    what = f"{', '.join(percent)} of the factory's response"
    if test.passed:
        return Finding("self test", Mark.OK, what, "", data), []
    moves = ((f"{name} {axis}", move) for name, each in shares.items() for axis, move in zip("xyz", each, strict=True))
    if dead := ", ".join(axis for axis, move in moves if abs(move) < LEAST_RESPONSE):
        what = f"{dead} did not move by the self test's force ({what})"
        return Finding(DEAD_AXIS, Mark.BAD, what, REPLACE, data), [DEAD_AXIS]
    remedy = "keep the board still and repeat; if it fails again, the chip is damaged or not genuine"
    return Finding("self test", Mark.BAD, what, remedy, data), ["its self test fails"]


def _offsets_and_bits(port: Port, part: Part, patience: int) -> Iterator[tuple[Finding, list[str]]]:
    """Examine the offset registers, and the bits that do not move when they shift the reading."""
    family, odd = part.family, None
    try:
        with temporary_measurement(port, patience) as measurement:
            try:
                response = measure_offset_response(port, measurement, family.accel_offset_h)
                yield _offsets(response, family)
            except UnknownOffsets as error:
                # A stuck bit makes the response of an axis odd, too.
                lsb_per_g = family.accel_offset_lsb_per_g
                odd, response = error, OffsetResponse(family.accel_offset_h, lsb_per_g, np.full(3, 1.0 / lsb_per_g))
            bits, axes = examine_bits(port, measurement, part, response)
    except ChipReset:
        raise
    except ChipError as error:
        # A board that moved tells nothing about the chip.
        moved = [MOVED] if isinstance(error, BoardMoved) else []
        yield Finding("offset registers", Mark.NOTE, error.what, error.remedy), moved
        return
    # Stuck bits of one axis or two explain an odd response; without any, or on all axes, the chip itself is odd.
    if odd is not None and axes in (0, 3):
        doubt = "its offset registers are unlike those of any genuine part"
        yield Finding("offset registers", Mark.NOTE, odd.what, odd.remedy), [doubt]
    else:
        yield bits, [STUCK_BITS] if axes else []


def _offsets(response: OffsetResponse, family: Family) -> tuple[Finding, list[str]]:
    where = f"0x{response.place[0]:02x}"
    data = {"place": response.place[0], "lsb_per_g": response.lsb_per_g, "g_per_lsb": response.g_per_lsb.tolist()}
    mg = ", ".join(f"{256_000 * value:.1f}" for value in response.g_per_lsb)
    what = f"at {where}, {response.lsb_per_g:.0f} LSB/g (256 counts moved x, y, z by {mg} mg)"
    usual = response.place == family.accel_offset_h
    doubts = [] if usual else [f"its offset registers are at {where}"]
    return Finding.check("offset registers", usual, what, "", data), doubts


def _verdict(sensor: Sensor, doubts: list[str]) -> Finding:
    for defect in (DEAD_AXIS, STUCK_BITS):
        if defect in doubts:
            return Finding("genuine?", Mark.UNKNOWN, f"undecided: {defect}", REPLACE)
    if MOVED in doubts:
        return Finding("genuine?", Mark.UNKNOWN, f"undecided: {MOVED}", "put it on a firm surface and try again")
    what = f"probably not genuine: {', '.join(doubts)}" if doubts else f"consistent with a genuine {sensor.chip}"
    remedy = "it can be used with mpucal; other software may misread it"
    return Finding.check("genuine?", not doubts, what, remedy, {"doubts": doubts})


def examine_chip(
    source: OpenedChip, seconds: float, examine_bus: Callable[[Any], Iterable[Finding]] = examine_speed
) -> Iterator[Finding]:
    """Examine a chip and its I2C bus; see examine."""
    with closing(source.bus):
        yield from examine(source.bus, source.plan.config, seconds, examine_bus)


def examine_chip_alone(source: OpenedChip, seconds: float) -> Iterator[Finding]:
    """Examine a chip on an SPI bus or a USB adapter, where times of replies do not show the bus's speed."""
    return examine_chip(source, seconds, lambda _bus: ())
