"""Simulated worlds in which faults begin at any time: the chip, its bus, the line, the vehicle, or the process.

A world is `--bus sim`, the same chip behind the emulated bridge, or `--mavlink sim`. Whenever its time goes on,
`World.reach` hears of it.
"""

import json
import os
import resource
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from mpucal.bridge.bus import BridgeBus
from mpucal.result.error_model import MG_PER_MPS2
from mpucal.simulated.chip import SimulatedBus, open_simulated
from mpucal.simulated.chip.bus import FaultInjector
from mpucal.simulated.disturbance import Mishap, zero_step
from mpucal.simulated.faults import OF_CHIP, OF_VEHICLE, Fault, Schedule, Where, begin_mishaps, fault_kinds
from mpucal.simulated.vehicle.transport import PacketLine, SimulatedTransport

from .bridge import EmulatedBridge, EmulatedLine
from .bridge.line import LineFaults

CHIP, BRIDGE, VEHICLE = "chip", "bridge", "vehicle"
SERIAL = tuple(fault_kinds(Where.SERIAL))
# faults of the process and its clock, in any world
STEP = "step"
PROCESS = ("killed", "terminated", "interrupted", "disk_full", "deaf")
CLOCK = ("stopped_5s", "suspended_2min")
PAUSES_S = {"stopped_5s": 5.0, "suspended_2min": 120.0}
SIGNALS = {"killed": signal.SIGKILL, "terminated": signal.SIGTERM, "interrupted": signal.SIGINT}
KINDS: dict[str, tuple[str, ...]] = {
    CHIP: (*fault_kinds(*OF_CHIP, Where.HAND, Where.DEFECT), STEP, *CLOCK, *PROCESS),
    BRIDGE: (*fault_kinds(*OF_CHIP, Where.HAND), STEP, *SERIAL, *CLOCK, *PROCESS),
    VEHICLE: (*fault_kinds(*OF_VEHICLE), *PROCESS),
}
SIMULATED = fault_kinds(*OF_CHIP, *OF_VEHICLE, Where.HAND, Where.DEFECT)
SPOILT_BYTES, WITHIN_BYTES = 40, 4000
STEP_MG = 3.0, 300.0
ROOM_BYTES, SAID_BYTES = 400_000, 20_000


@dataclass(frozen=True)
class TimedFault:
    """Fault, one of KINDS, at a time of the world's clock, with a number that varies it."""

    name: str
    at_s: float
    number: int

    def __str__(self) -> str:
        return f"{self.name}@{self.at_s:g}"


class World:
    """Simulated world: the sources that the hooks below have opened; one for each process.

    Attributes
    ----------
    due : times [s] of the world's clock, the earliest first, and the functions that are called then.
    """

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self.due: list[tuple[float, Callable[[], None]]] = []
        self.bus: HookedBus | None = None
        self.line: EmulatedLine | None = None
        self.transport: HookedTransport | None = None

    def reach(self, now_s: float) -> None:
        """Call the functions that are due at `now_s`."""
        while self.due and self.due[0][0] <= now_s:
            self.due.pop(0)[1]()

    def at(self, at_s: float, call: Callable[[], None]) -> None:
        """Have a function called at a time [s]."""
        self.due = sorted([*self.due, (at_s, call)], key=lambda item: item[0])

    @contextmanager
    def opened(self) -> Iterator[None]:
        """Open this world by `--bus sim` and `--mavlink sim` while the block runs."""

        def bridged(*arguments: Any) -> Bridged:
            return Bridged(open_simulated(*arguments), self)

        with (
            patch("mpucal.simulated.chip.SimulatedBus", lambda *a: HookedBus(self, *a)),
            patch("mpucal.simulated.vehicle.SimulatedTransport", lambda v: HookedTransport(self, v)),
            patch("mpucal.simulated.chip.open_simulated", bridged if self.kind == BRIDGE else open_simulated),
        ):
            yield

    def begin_faults(self, faults: Sequence[TimedFault]) -> None:
        """Begin these faults, each at its time."""
        if self.bus is not None and self.bus._motion is not None:
            self.bus.begin_faults(_faults(faults), faults[0].number)
            self.bus._motion.mishaps = (*self.bus._motion.mishaps, *_sensor_faults(faults))
        if self.transport is not None:
            self.transport.begin_faults(_faults(faults))
        for fault in faults:
            if fault.name in (*PROCESS, *CLOCK, *SERIAL):
                self.at(fault.at_s, partial(self._begin, fault))

    def truths(self, faults: Sequence[TimedFault], folder: Path) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return the values of (D, b_a) that count as true: before and after each fault, and amid slow ones."""
        document = json.loads((folder / "truth.json").read_text())
        D, b_a = np.array(document["D"], float), np.array(document["b_a"], float)
        maps = []
        for mishap in _sensor_faults(faults):
            times = mishap.begun_s + np.array([-1.0, 10.0, 20.0, 30.0, 1000.0])
            maps.append([_affine(mishap, t) for t in times])
        found = []
        for chosen in product(*maps):
            A, c = np.eye(3), np.zeros(3)
            for turn, shift in chosen:
                A, c = turn @ A, turn @ c + shift
            found.append((D @ A, b_a + D @ c))
        return found

    def _begin(self, fault: TimedFault) -> None:
        if fault.name in SIGNALS:
            os.kill(os.getpid(), SIGNALS[fault.name])
        elif fault.name == "disk_full":
            # no file may grow beyond this, as on a full disk; messages on stderr go to a file, too, and get their room
            room = max(fault.number % ROOM_BYTES, os.fstat(2).st_size + SAID_BYTES)
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (room, resource.RLIM_INFINITY))
        elif fault.name == "deaf":
            os.dup2(os.open("/dev/full", os.O_WRONLY), 2)
        elif fault.name in CLOCK and self.bus is not None:
            self.bus._clock.spend(round(PAUSES_S[fault.name] * 1e9))
        elif fault.name in SERIAL and self.line is not None:
            rng = np.random.default_rng(fault.number)
            places = rng.integers(0, WITHIN_BYTES, SPOILT_BYTES)
            spoilt = [(int(at), fault.name, int(rng.integers(1, 256))) for at in places]
            if rng.random() < 0.5:
                self.line.to_host = LineFaults(spoilt)
            else:
                self.line.to_device = LineFaults([(at // 16, name, value) for at, name, value in spoilt])


class HookedBus(SimulatedBus):
    """Simulated bus that reports the time of each transfer to the world."""

    def __init__(self, world: World, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._world = world
        world.bus = self

    def read(self, register: int, count: int) -> Any:
        """See SimulatedBus."""
        self._world.reach(self._clock.now() * 1e-9)
        return super().read(register, count)

    def write(self, register: int, data: bytes) -> int:
        """See SimulatedBus."""
        self._world.reach(self._clock.now() * 1e-9)
        return super().write(register, data)

    def begin_faults(self, faults: Sequence[Fault], seed: int) -> None:
        """Begin these faults now."""
        self._faults = FaultInjector(faults, self._chip, self._clock, np.random.default_rng(seed)) if faults else None


class Bridged(BridgeBus):
    """The simulated chip behind the emulated bridge and its line."""

    real_time = False

    def __init__(self, chip: SimulatedBus, world: World) -> None:
        world.line = EmulatedLine(EmulatedBridge(chip, chip._clock.now), chip._clock, step_ns=5_000_000)
        self.hear, self.truth_document = chip.hear, chip.truth_document
        super().__init__(world.line)


class HookedTransport(SimulatedTransport):
    """Link of the simulated vehicle that reports the time of each read to the world."""

    def __init__(self, world: World, vehicle: Any) -> None:
        super().__init__(vehicle)
        self._world = world
        world.transport = self

    def receive(self, until_ns: int) -> Any:
        """See Transport."""
        self._world.reach(self._vehicle.now_us * 1e-6)
        return super().receive(until_ns)

    def begin_faults(self, faults: Sequence[Fault]) -> None:
        """Begin these faults now."""
        vehicle = self._vehicle
        vehicle.options = replace(vehicle.options, fault=tuple(faults))
        vehicle._schedule = Schedule(faults)
        self._line = PacketLine(faults, vehicle.options.seed)


def _faults(faults: Sequence[TimedFault]) -> list[Fault]:
    """Return those that the simulation's table of faults has."""
    known = [fault for fault in faults if fault.name in SIMULATED]
    return [Fault(fault.name, fault.at_s if SIMULATED[fault.name].timed else 0.0) for fault in known]


def _sensor_faults(faults: Sequence[TimedFault]) -> list[Mishap]:
    """Return the faults of the sensor; a vehicle has none."""
    return [*begin_mishaps(_faults(faults)), *(_step(fault) for fault in faults if fault.name == STEP)]


def _step(fault: TimedFault) -> Mishap:
    rng = np.random.default_rng(fault.number)
    direction = rng.normal(size=3)
    size = np.exp(rng.uniform(*np.log(STEP_MG))) / MG_PER_MPS2
    return Mishap(partial(zero_step, step_mps2=direction / np.linalg.norm(direction) * size), fault.at_s)


def _affine(mishap: Mishap, t_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Return (A, c): the sensor measures the specific force s as A s + c at that time."""
    at = np.full(4, t_s)
    felt, _ = mishap.apply(np.vstack((np.zeros(3), np.eye(3))), np.zeros((4, 3)), at)
    return (felt[1:] - felt[0]).T, felt[0]
