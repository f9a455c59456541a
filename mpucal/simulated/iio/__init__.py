"""Simulated chip behind a simulated kernel driver, which `--iio sim` opens."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ...iio.driver import Devices
from ...iio_device.source import OpenedIio
from ...sources.kind import Request
from ..chip import open_simulated, with_long_polls
from .files import SimulatedFiles

__all__ = ["SimulatedFiles", "open_source"]
DEVICE = "iio:device0"


def open_source(request: Request) -> OpenedIio:
    """Open the chip that `sim:key=value,...` describes, in the gravity of the plan; see open_simulated."""
    bus = open_simulated(request.value, request.plan.gravity, request.values.get("seed"))
    files: Any = SimulatedFiles(bus)
    return OpenedIio(
        files,
        replace(request.plan, config=with_long_polls(request.plan.config, bus.real_time)),
        (bus.hear,),
        bus.truth_document,
        words=request.words,
        real_time=bus.real_time,
        # The buffers are filled while they are read.
        own_process=bus.real_time,
        devices=Devices(DEVICE, DEVICE),
        trigger=request.values.get("trigger"),
    )
