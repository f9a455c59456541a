"""The simulated chip as a source: what `--bus sim` opens."""

from __future__ import annotations

from dataclasses import replace

from ...chip.config import MAX_FRAMES_A_POLL
from ...session.plan import Plan
from ...sources.chip import OpenedChip
from ...sources.kind import Request
from . import open_simulated

# nobody waits for the samples of a simulation that runs as fast as it can, and no host is late
SELDOM_S = 0.12


def open_source(request: Request) -> OpenedChip:
    """The chip that `sim:key=value,...` describes, in the gravity of the plan; see open_simulated."""
    bus = open_simulated(request.value, request.plan.gravity, request.values.get("seed"))
    plan = request.plan if bus.real_time else _seldom(request.plan)
    return OpenedChip(bus, plan, (bus.hear,), bus.truth_document(), words=request.words, real_time=bus.real_time)


def _seldom(plan: Plan) -> Plan:
    """The same, with longer between two looks into the FIFO."""
    config = plan.config
    return replace(plan, config=replace(config, poll_s=min(SELDOM_S, MAX_FRAMES_A_POLL / config.rate_hz)))
