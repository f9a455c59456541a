"""What the words of the source options open. Knows no session."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..bus.i2c import I2cBus
from ..bus.replay import ReplayBus
from ..bus.simulated import open_simulated
from ..capture.mcap import read_capture
from ..chip.access import Bus
from ..chip.config import Config
from ..errors import UsageError
from ..runner import Replayed, Talk
from ..session.events import Prompt
from ..session.plan import Plan

SIMULATED = "sim"


@dataclass(frozen=True)
class Opened:
    """A bus, and what comes with its kind.

    Attributes
    ----------
    bus : open. plan : what to do with it.
    listeners : hear the prompts besides the person. truth : of a simulated sensor.
    replay : the same bus where it is a replay. recovered : how much of a damaged capture it holds.
    """

    bus: Bus
    plan: Plan
    listeners: Sequence[Callable[[Prompt], None]] = ()
    truth: Mapping[str, Any] | None = None
    replay: ReplayBus | None = None
    recovered: str | None = None

    def talk(self, person: Talk) -> Talk:
        """Who presses the keys: the person, or the person in the capture."""
        return person if self.replay is None else Replayed(person, self.replay.pending_events)


def open_bus(text: str, plan: Plan, address: int | None, seed: int | None) -> Opened:
    """A Linux I2C bus, or the simulated chip.

    Raises
    ------
    UsageError : words that fit no bus. BusError : no such bus, or no permission.
    """
    if text == SIMULATED or text.startswith(SIMULATED + ":"):
        if address is not None:
            raise UsageError("--address is where a real chip answers, and --bus names a simulated one", "leave it out")
        bus = open_simulated(text, plan.gravity, seed)
        return Opened(bus, plan, (bus.hear,), bus.truth_document())
    if seed is not None:
        raise UsageError("--seed chooses a simulated sensor, and --bus names a real one", "leave it out")
    return Opened(I2cBus(text, address), plan)


def open_replay(file: Path) -> Opened:
    """A capture, to be run again.

    Raises
    ------
    CaptureError : no capture, or one of another driver.
    """
    capture = read_capture(file)
    bus = ReplayBus(capture.records, capture.name)
    plan = Plan.of_capture(capture.meta, capture.name)
    return Opened(bus, plan, replay=bus, recovered=capture.recovered)


def opened(options: Mapping[str, Any], until_end: bool = False) -> Opened:
    """What --bus or --replay of a command's `options` names, with the options beside it."""
    if options["replay"] is not None:
        return open_replay(options["replay"])
    config = Config(int(options["accel_range"]), int(options["gyro_range"]), options["rate"])
    plan = Plan(config, options["gravity"], options["model"], until_end)
    return open_bus(options["bus"], plan, options["address"], options["seed"])
