"""Table of simulated faults, from which `sim:fault=`, its error messages and the tables of the documentation are made.

A transfer fails as on Linux: OSError with the errno of Documentation/i2c/fault-codes.rst.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from enum import StrEnum
from errno import EREMOTEIO, ETIMEDOUT
from functools import partial
from typing import NamedTuple, Self

from ..chip.fifo import ACCEL, GYRO, TEMPERATURE
from ..chip.registers import FIFO_COUNT_H, FIFO_R_W
from .disturbance import Change, Mishap, knock, slip, warming, zero_step


class Where(StrEnum):
    """Parts of the simulated world that a fault affects."""

    CHIP = "chip"
    BUS = "bus"
    HAND = "hand"
    VEHICLE = "vehicle"
    LINK = "link"
    SERIAL = "serial"
    DEFECT = "defect"


OF_CHIP = (Where.BUS, Where.CHIP)
OF_VEHICLE = (Where.VEHICLE, Where.LINK)


class FaultKind(NamedTuple):
    """A row of the table; a field that is not given has no effect.

    Attributes
    ----------
    name : as in an option. where : the part that it affects. what : its description.
    timed : it begins at a time; otherwise it is there from the start.
    seconds : its duration. again_s : time until it repeats.
    errno : error of every transfer meanwhile. takes_s : duration of such a transfer.
    flips : bits of the bytes that arrive are flipped meanwhile. pause_s : time for which the host does nothing.
    begin : called as it begins, with the chip, this time and the end [ns], or with the vehicle.
    share : of the packets or bytes that it affects.
    spoils : makes bytes of a byte on a serial line and a number from 1 to 255, which varies the damage.
    mishap : change of the sensor.
    pins : a word of a sample by number, or a slice of them, and the count at which they stay.
    alters : makes another reply of a register and its data.
    """

    name: str
    where: Where
    what: str
    timed: bool = True
    seconds: float = 0.0
    again_s: float | None = None
    errno: int | None = None
    takes_s: float = 0.0
    flips: bool = False
    pause_s: float = 0.0
    begin: Callable[..., None] | None = None
    share: float = 0.0
    spoils: Callable[[int, int], bytes] | None = None
    mishap: Change | None = None
    pins: tuple[int | slice, int] | None = None
    alters: Callable[[int, bytes], bytes] | None = None


def _of_a_clock(register: int, data: bytes) -> bytes:
    """Return the reply of a DS3231 at 12:00:07 on a Saturday, which repeats its 19 registers."""
    held = bytes([0x07, 0x00, 0x12, 0x07, 0x21, 0x11, 0x26]) + bytes(12)
    return bytes(held[(register + i) % len(held)] for i in range(len(data)))


def _without_fifo(register: int, data: bytes) -> bytes:
    """Return zeros for FIFO_COUNT and the FIFO."""
    return bytes(len(data)) if FIFO_COUNT_H <= register <= FIFO_R_W else data


BUS, CHIP, HAND, VEHICLE = Where.BUS, Where.CHIP, Where.HAND, Where.VEHICLE
LINK, SERIAL, DEFECT = Where.LINK, Where.SERIAL, Where.DEFECT
ALWAYS = partial(FaultKind, timed=False)

# fmt: off
_ROWS = (
    FaultKind("nack", BUS, "for 0.3 s the chip does not acknowledge", seconds=0.3, errno=EREMOTEIO),
    FaultKind("timeout", BUS, "for 0.5 s each transfer takes 0.1 s and fails",
              seconds=0.5, errno=ETIMEDOUT, takes_s=0.1),
    FaultKind("overflow", BUS, "the host sleeps for 2 s", pause_s=2.0),
    FaultKind("brownout", CHIP, "the chip resets, and is gone for 50 ms", seconds=0.05, errno=EREMOTEIO,
              begin=lambda chip, t_ns, _: chip.reset(t_ns)),
    FaultKind("stuck", BUS, "a wire stays low from then on", seconds=math.inf, errno=ETIMEDOUT, takes_s=0.1),
    FaultKind("unplugged", BUS, "a wire is pulled, and stays so", seconds=math.inf, errno=EREMOTEIO),
    FaultKind("bitflips", BUS, "for 0.5 s one byte in 200 arrives with a bit flipped, in either direction",
              seconds=0.5, flips=True, share=1 / 200),
    FaultKind("clock", CHIP, "the sample clock runs 1 % faster from then on",
              begin=lambda chip, t_ns, _: chip.change_speed(1.01, t_ns)),
    FaultKind("frozen", CHIP, "for 1 s the sensor repeats itself", seconds=1.0,
              begin=lambda chip, _, end_ns: chip.freeze(end_ns)),
    FaultKind("slip", CHIP, "the FIFO loses a byte", begin=lambda chip, t_ns, _: chip.lose_fifo_byte(t_ns)),
    FaultKind("low_byte", CHIP, "the low byte of the accelerometer's x stays 0 from then on",
              begin=lambda chip, *_: chip.clear_bits(0, 0xFF)),
    FaultKind("high_bit", CHIP, "bit 12 of the accelerometer's y stays 0 from then on",
              begin=lambda chip, *_: chip.clear_bits(1, 1 << 12)),
    FaultKind("bit_errors", BUS, "from then on one byte in 2,000 arrives with a bit flipped, in either direction",
              seconds=math.inf, flips=True, share=1 / 2000),
    ALWAYS("nacks", DEFECT, "one transfer in fifty is not acknowledged",
           seconds=math.inf, errno=EREMOTEIO, share=1 / 50),
    ALWAYS("stuckbit", DEFECT, "bit 4 of every byte that is read is 1",
           alters=lambda _, data: bytes(byte | 0x10 for byte in data)),
    ALWAYS("ones", DEFECT, "every byte that is read is 0xff: SDA is not connected",
           alters=lambda _, data: b"\xff" * len(data)),
    ALWAYS("zeros", DEFECT, "every byte that is read is 0", alters=lambda _, data: bytes(len(data))),
    ALWAYS("rtc", DEFECT, "a DS3231 clock answers in its place", alters=_of_a_clock),
    ALWAYS("no_fifo", DEFECT, "the FIFO stays empty", alters=_without_fifo),
    ALWAYS("low_x", DEFECT, "accelerometer x stays at -32768", pins=(0, -32768)),
    ALWAYS("zero_z", DEFECT, "accelerometer z stays at 0", pins=(2, 0)),
    ALWAYS("zero_acc", DEFECT, "the accelerometer stays at 0", pins=(ACCEL, 0)),
    ALWAYS("full_acc", DEFECT, "the accelerometer stays at 32767", pins=(ACCEL, 32767)),
    ALWAYS("zero_gyro", DEFECT, "the gyroscope stays at 0", pins=(GYRO, 0)),
    ALWAYS("stuck_ax", DEFECT, "accelerometer x stays at 1234", pins=(0, 1234)),
    ALWAYS("zero_gz", DEFECT, "gyroscope z stays at 0", pins=(6, 0)),
    ALWAYS("stuck_gy", DEFECT, "gyroscope y stays at -15", pins=(5, -15)),
    ALWAYS("stuck_temp", DEFECT, "the thermometer stays at 0", pins=(TEMPERATURE, 0)),
    FaultKind("loose", HAND, "the accelerometer turns by 8 deg on its mount", mishap=slip),
    FaultKind("knock", HAND, "a blow, which leaves the accelerometer's bias changed by 0.4 m/s²", mishap=knock),
    FaultKind("zero_step", HAND, "the accelerometer's bias steps by 10 mg on x", mishap=zero_step),
    FaultKind("warming", HAND, "the chip warms by 15 °C within 40 s, and its biases follow", mishap=warming),
    FaultKind("arm", VEHICLE, "it is armed", begin=lambda vehicle: vehicle.arm()),
    FaultKind("reboot", VEHICLE, "it reboots, and is silent for 2 s", begin=lambda vehicle: vehicle.reboot()),
    FaultKind("silence", VEHICLE, "it sends and hears nothing any more", begin=lambda vehicle: vehicle.fall_silent()),
    FaultKind("second_station", VEHICLE,
              "another station asks for 4 Hz of everything, every 15 s, as a MAVProxy at its default does",
              again_s=15.0, begin=lambda vehicle: vehicle.obey_second_station()),
    FaultKind("autocal", VEHICLE, "a PX4 with SENS_IMU_AUTOCAL commits the accelerometer offsets that it learnt",
              begin=lambda vehicle: vehicle.learn_offsets()),
    ALWAYS("phantom", VEHICLE, "IMUs that an ArduPilot does not have are sent as zeros"),
    ALWAYS("loss", LINK, "one packet in five is lost", share=0.2),
    ALWAYS("reorder", LINK, "one packet in ten is overtaken by three others", share=0.1),
    ALWAYS("duplicate", LINK, "one packet in ten comes twice", share=0.1),
    FaultKind("lost", SERIAL, "a byte is lost", spoils=lambda byte, _: b""),
    FaultKind("twice", SERIAL, "a byte comes twice", spoils=lambda byte, _: bytes([byte, byte])),
    FaultKind("flipped", SERIAL, "bits of a byte are flipped", spoils=lambda byte, v: bytes([byte ^ v])),
    FaultKind("noise", SERIAL, "up to 89 bytes of noise", spoils=lambda byte, v: bytes([byte]) + bytes(v % 90)),
    FaultKind("late", SERIAL, "what follows comes with what is sent next"),
)
# fmt: on
FAULTS = {kind.name: kind for kind in _ROWS}


def fault_kinds(*where: Where) -> dict[str, FaultKind]:
    """Return the rows of faults that affect any of these parts, by name."""
    return {name: kind for name, kind in FAULTS.items() if kind.where in where}


class Fault(NamedTuple):
    """A fault by its name in FAULTS, which begins at `at_s` of its world's clock; 0 if it is not timed."""

    name: str
    at_s: float = 0.0

    def __str__(self) -> str:
        return f"{self.name}@{self.at_s:g}" if self.kind.timed else self.name

    @classmethod
    def parse(cls, text: str, *where: Where) -> Self:
        """Parse NAME@SECONDS, or NAME of one that is not timed; raise KeyError or ValueError otherwise."""
        name, at, seconds = text.partition("@")
        if fault_kinds(*where)[name].timed != bool(at):
            raise ValueError(text)
        at_s = float(seconds) if at else 0.0
        if not 0 <= at_s < math.inf:
            raise ValueError(text)
        return cls(name, at_s)

    @property
    def kind(self) -> FaultKind:
        """Row of the table."""
        return FAULTS[self.name]

    @property
    def begin_ns(self) -> int:
        """Time of its begin."""
        return round(self.at_s * 1e9)

    @property
    def end_ns(self) -> float:
        """Time of its end."""
        return self.begin_ns + self.kind.seconds * 1e9


class Schedule:
    """Schedule of the timed ones of `faults`, with their repetitions."""

    def __init__(self, faults: Iterable[Fault]) -> None:
        timed = sorted((fault for fault in faults if fault.kind.timed), key=lambda fault: fault.at_s)
        self._waiting = [(fault.begin_ns, fault) for fault in timed]

    def next_ns(self) -> float:
        """Return the time of the next one, infinity if there is none."""
        return min((at_ns for at_ns, _ in self._waiting), default=math.inf)

    def due(self, now_ns: int) -> list[Fault]:
        """Return the faults that begin by `now_ns`, since the last call, in order."""
        if not self._waiting:
            return []
        due = [(at_ns, fault) for at_ns, fault in self._waiting if at_ns <= now_ns]
        self._waiting = [later for later in self._waiting if later[0] > now_ns]
        for at_ns, fault in due:
            if fault.kind.again_s is not None:
                self._waiting.append((at_ns + round(fault.kind.again_s * 1e9), fault))
        return [fault for _, fault in due]


def begin_mishaps(faults: Iterable[Fault]) -> list[Mishap]:
    """Return the mishaps of the sensor, each scheduled at its time."""
    return [Mishap(fault.kind.mishap, fault.at_s) for fault in faults if fault.kind.mishap is not None]
