"""The captures of faulty runs, all from seeds, for fixtures.py.

faults/NAME.mcap is what crossed the bus while the driver measured a simulated chip, ten seconds at 50 Hz, that suffered
the fault NAME at the fifth; NAME.json beside it is what the driver made of it: what a replay must make of it too.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from mpucal.chip.access import Bus
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.data import Recording
from mpucal.errors import EndOfCapture, SourceError
from mpucal.files.mcap import CaptureWriter
from mpucal.session.plan import Plan
from mpucal.simulated.chip import open_simulated
from mpucal.simulated.faults import OF_CHIP, kinds
from mpucal.sources.tap import Tap

PLAN = Plan(Config(rate_hz=50))
FAULT_S, END_S = 5.0, 10.0


def measured(bus: Bus) -> tuple[Recording, str | None]:
    """What the driver measures on `bus` until ten seconds are over or it gives up, and why it gave up."""
    driver = Driver(bus, PLAN.config)
    try:
        driver.start()
        while driver.now_ns() < END_S * 1e9:
            driver.poll()
    except EndOfCapture:
        return driver.recording(), None
    except SourceError as error:
        return driver.recording(), str(error)
    driver.stop()
    return driver.recording(), None


def made_of_it(recording: Recording, why: str | None) -> dict[str, Any]:
    """The same as JSON."""
    return {
        "samples": len(recording),
        "gaps": int(recording.gap.sum()),
        "rate_hz": recording.sensor.rate_hz,
        "gave_up": why,
    }


def write(folder: Path) -> None:
    """Make them all."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in kinds(*OF_CHIP):
        simulated = open_simulated(f"sim:seed=8,chip=mpu6500,fault={name}@{FAULT_S:g}")
        with CaptureWriter(folder / f"{name}.mcap") as writer:
            writer.start(PLAN.meta())
            found = made_of_it(*measured(Tap(simulated, writer)))
        (folder / f"{name}.json").write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
