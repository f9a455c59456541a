"""What the words of the source options open. Knows no session."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..bus.i2c import I2cBus
from ..bus.replay import ReplayBus
from ..bus.simulated import open_simulated
from ..capture.mcap import read_capture
from ..chip.config import Config
from ..errors import UsageError
from ..session.plan import Plan
from .on_bus import OnBus
from .opened import Opened

SIMULATED = "sim"


def open_bus(text: str, plan: Plan, address: int | None, seed: int | None) -> OnBus:
    """A Linux I2C bus, or the simulated chip.

    Raises
    ------
    UsageError : words that fit no bus. BusError : no such bus, or no permission.
    """
    if text == SIMULATED or text.startswith(SIMULATED + ":"):
        if address is not None:
            raise UsageError("--address is where a real chip answers, and --bus names a simulated one", "leave it out")
        bus = open_simulated(text, plan.gravity, seed)
        return OnBus(bus, plan, (bus.hear,), bus.truth_document())
    if seed is not None:
        raise UsageError("--seed chooses a simulated sensor, and --bus names a real one", "leave it out")
    return OnBus(I2cBus(text, address), plan)


def open_replay(file: Path) -> OnBus:
    """A capture, to be run again.

    Raises
    ------
    CaptureError : no capture, or one of another driver.
    """
    capture = read_capture(file)
    bus = ReplayBus(capture.records, capture.name)
    plan = Plan.of_capture(capture.meta, capture.name)
    return OnBus(bus, plan, replay=bus, recovered=capture.recovered)


def opened(options: Mapping[str, Any], until_end: bool = False) -> Opened:
    """What --bus or --replay of a command's `options` names, with the options beside it."""
    if options["replay"] is not None:
        return open_replay(options["replay"])
    config = Config(int(options["accel_range"]), int(options["gyro_range"]), options["rate"])
    plan = Plan(config, options["gravity"], options["model"], until_end)
    return open_bus(options["bus"], plan, options["address"], options["seed"])
