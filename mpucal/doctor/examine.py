"""The examination of a chip on any bus, step by step.

The offset registers hold afterwards what they held before: the reset that identifying takes reloads the factory's
trim, and whoever had corrected it would miss that.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress

import numpy as np

from ..chip.access import Bus
from ..chip.config import MOST_POLLED_HZ, Config
from ..chip.decode import Decoder
from ..chip.driver import NO_FIFO, Driver
from ..chip.families import PARTS, Family, Part
from ..chip.fifo import FifoFault
from ..chip.identity import describe_mismatch
from ..chip.offset_response import OffsetResponse, measure_offset_response
from ..chip.offsets import PLACES, OffsetRegisters, restore
from ..chip.port import Port
from ..chip.probe import read_identity
from ..chip.quick_measure import PATIENCE, TemporaryMeasurement
from ..chip.self_test import SelfTest, run_self_test
from ..chip.transfer_stats import REMEDY, TransferStats
from ..data import Sensor
from ..errors import ChipError, ChipReset, OddOffsets, SourceError
from .bits import examine_bits
from .dead import DEAD_AXIS, REPLACE, STUCK_BITS, named
from .finding import Finding, Mark, failed
from .measure import examine_stream
from .speed import examine_speed

# of the transfers: a session bears some, and none when most fail
MANY, MOST = 0.05, 0.5

# of what the factory measured: an axis that moves by less is dead
UNMOVED = 0.05

# a board that was waited for in vain is not waited for once more
IMPATIENCE = 3

# of gaps, with what helps
CAUSES = {
    FifoFault.OVERFLOW: ("the FIFO overflowed: it was read too late", "end other programs, or take a lower --rate"),
    FifoFault.LATE: ("a sample was read too late", "end other programs, or take a lower --rate"),
    FifoFault.MISALIGNED: ("the frames in the FIFO slipped", REMEDY),
    FifoFault.LOST: ("the chip lost its settings: it was reset", "its supply breaks down: check its wires, and motors"),
    FifoFault.STUCK: ("the sensor repeated itself", "if that happens again and again, replace the chip"),
}

Look = Callable[[Bus], Iterable[Finding]]


def examine(bus: Bus, config: Config, seconds: float, way: Look = examine_speed) -> Iterator[Finding]:
    """Everything that asking the chip tells; ends early where it does not answer.

    Parameters
    ----------
    seconds : how long to watch its stream; the board is to lie still. way : examines what leads to the chip.
    """
    stats = TransferStats()
    port = Port(bus, Decoder("doctor"), stats)
    patience = IMPATIENCE
    try:
        # a stranger is not written to
        read_identity(port)
        olds = [OffsetRegisters.read(port, place) for place in PLACES]
        yield from way(bus)
        with suppress(ChipError), TemporaryMeasurement(port) as measurement:
            # until the board is put down; one that is not is told of later
            measurement.rest()
            patience = PATIENCE
    except SourceError as error:
        yield from _transfers(stats)
        yield failed("chip", error)
        return
    driver = Driver(bus, config, "doctor", stats=stats)
    try:
        yield from _awake(port, driver, config, seconds, olds, patience)
    except SourceError as error:
        yield from _transfers(stats)
        yield failed("broken off", error)
    else:
        yield from _transfers(stats, always=True)
    finally:
        driver.stop()
        with suppress(SourceError):
            for old in olds:
                restore(port, old)


def _transfers(stats: TransferStats, always: bool = False) -> Iterator[Finding]:
    """How many failed; not of a bus on which nothing worked."""
    data = {"transfers": stats.transfers, "retries": stats.retries, "errors": dict(stats.errors)}
    if not stats.errors:
        if always:
            yield Finding("transfers", Mark.OK, str(stats), "", data)
        return
    if always or stats.error_share < MOST:
        yield Finding("transfers", Mark.BAD if stats.error_share > MANY else Mark.NOTE, str(stats), stats.remedy, data)


def _awake(
    port: Port, driver: Driver, config: Config, seconds: float, olds: list[OffsetRegisters], patience: int
) -> Iterator[Finding]:
    sensor = driver.start()
    part, family = driver.part, driver.part.family
    yield _identity(sensor)
    if not part.fifo_bytes:
        yield Finding("FIFO", Mark.NOTE, NO_FIFO, f"take --rate {MOST_POLLED_HZ} or less, and a bus of 400 kHz")
    yield _held(port, family, olds)
    end_ns = driver.now_ns() + round(seconds * 1e9)
    while driver.now_ns() < end_ns:
        driver.poll()
    recording = driver.recording()
    if len(recording) > config.rate_hz:
        yield from examine_stream(recording, config.rate_hz, seconds, family)
    else:
        yield Finding(
            "stream", Mark.BAD, f"{len(recording)} samples in {seconds:g} s", "check the wires and the supply"
        )
    for fault, times in driver.faults.items():
        yield Finding(
            "gaps", Mark.BAD, f"{times} × {CAUSES[fault][0]}", CAUSES[fault][1], {"fault": fault, "times": times}
        )
    if driver.repaired:
        what = f"{driver.repaired} of {len(recording)} samples had a bit flipped on the bus, and were set right"
        yield Finding("bit errors", Mark.BAD, what, REMEDY, {"flipped": driver.repaired, "samples": len(recording)})
    driver.stop()
    named = PARTS.get(sensor.who_am_i or 0)
    answers_as_it_is = named is not None and named.family.name == family.name
    doubts = [] if answers_as_it_is else ["WHO_AM_I and behaviour disagree"]
    for finding, doubt in (_self_test(port, part), *_shifted(port, part, patience)):
        yield finding
        doubts += doubt
    yield _verdict(sensor, doubts)


def _identity(sensor: Sensor) -> Finding:
    other = describe_mismatch(sensor)
    data = {"chip": sensor.chip, "who_am_i": sensor.who_am_i, "accel_range_g": sensor.accel_range_g}
    if other is None:
        return Finding("chip", Mark.OK, f"{sensor.chip}, WHO_AM_I 0x{sensor.who_am_i or 0:02x}", "", data)
    return Finding("chip", Mark.NOTE, other, "", data)


def _held(port: Port, family: Family, olds: list[OffsetRegisters]) -> Finding:
    old = next(block for block in olds if block.place == family.accel_offset_h)
    trim = OffsetRegisters.read(port, old.place).words
    data = {"held": list(old.words), "trim": list(trim), "place": old.place[0]}
    if old.words == trim:
        return Finding("factory trim", Mark.OK, f"{', '.join(map(str, trim))} at 0x{old.place[0]:02x}", "", data)
    return Finding(
        "factory trim",
        Mark.NOTE,
        f"{', '.join(map(str, trim))} at 0x{old.place[0]:02x}; replaced by {', '.join(map(str, old.words))}",
        "restored after this examination; a session resets the chip and measures with the factory trim",
        data,
    )


def _self_test(port: Port, part: Part) -> tuple[Finding, list[str]]:
    test = run_self_test(port, part)
    data = {"accel_shares": _listed(test.accel_shares), "gyro_shares": _listed(test.gyro_shares)}
    if not test.has_codes:
        what = "the chip has no factory codes to compare with"
        return Finding("self test", Mark.NOTE, what, "", data), ["it has no self-test codes"]
    accel, gyro = (", ".join(f"{100 * share:.0f}" for share in each) for each in (test.accel_shares, test.gyro_shares))
    what = f"accelerometer {accel} %, gyroscope {gyro} % of what the factory measured"
    if test.passed:
        return Finding("self test", Mark.OK, what, "", data), []
    if dead := _unmoved(test):
        what = f"{dead} did not move by the self test's force ({what})"
        return Finding(DEAD_AXIS, Mark.BAD, what, REPLACE, data), [DEAD_AXIS]
    remedy = "keep the board still and repeat; if it fails again, the chip is damaged or not genuine"
    return Finding("self test", Mark.BAD, what, remedy, data), ["its self test fails"]


def _unmoved(test: SelfTest) -> str:
    """The axes that answered with about nothing, in words."""
    return named(
        {"accelerometer": test.accel_shares, "gyroscope": test.gyro_shares}, lambda share: abs(share) < UNMOVED
    )


def _shifted(port: Port, part: Part, patience: int) -> Iterator[tuple[Finding, list[str]]]:
    """What the offset registers do, and the bits that do not move when they shift what is measured."""
    family, odd = part.family, None
    try:
        with TemporaryMeasurement(port, patience) as measurement:
            try:
                response = measure_offset_response(port, measurement, family.accel_offset_h)
                yield _offsets(response, family)
            except OddOffsets as error:
                # a bit that is stuck makes an axis answer oddly, too
                lsb_per_g = family.accel_offset_lsb_per_g
                odd, response = error, OffsetResponse(family.accel_offset_h, lsb_per_g, np.full(3, 1.0 / lsb_per_g))
            bits, axes = examine_bits(port, measurement, part, response)
    except ChipReset:
        raise
    except ChipError as error:
        # a board that moved says nothing about the chip
        yield Finding("offset registers", Mark.NOTE, error.what, error.remedy), []
        return
    if odd is not None and axes in (0, 3):
        doubt = "its offset registers are not as in any genuine part"
        yield Finding("offset registers", Mark.NOTE, odd.what, odd.remedy), [doubt]
    else:
        yield bits, [STUCK_BITS] if axes else []


def _offsets(response: OffsetResponse, family: Family) -> tuple[Finding, list[str]]:
    where = f"0x{response.place[0]:02x}"
    data = {"place": response.place[0], "lsb_per_g": response.lsb_per_g, "g_per_lsb": response.g_per_lsb.tolist()}
    mg = ", ".join(f"{256_000 * value:.1f}" for value in response.g_per_lsb)
    what = f"at {where}, {response.lsb_per_g:.0f} LSB/g (256 counts moved x, y, z by {mg} mg)"
    if response.place == family.accel_offset_h:
        return Finding("offset registers", Mark.OK, what, "", data), []
    return Finding("offset registers", Mark.NOTE, what, "", data), [f"its offset registers are at {where}"]


def _verdict(sensor: Sensor, doubts: list[str]) -> Finding:
    for defect in (DEAD_AXIS, STUCK_BITS):
        if defect in doubts:
            return Finding("genuine?", Mark.UNKNOWN, f"undecided: {defect}", REPLACE)
    if not doubts:
        return Finding("genuine?", Mark.OK, f"consistent with a genuine {sensor.chip}", "", {"doubts": []})
    return Finding(
        "genuine?",
        Mark.NOTE,
        f"probably not genuine: {', '.join(doubts)}",
        "it can be used with mpucal; other software may misread it",
        {"doubts": doubts},
    )


def _listed(shares: np.ndarray) -> list[float | None]:
    return [float(share) if np.isfinite(share) else None for share in shares]
