"""Simulated chip as a source, which `--bus sim` opens."""

from __future__ import annotations

from dataclasses import replace

from ...chip.config import MAX_FRAMES_A_POLL
from ...session.plan import Plan
from ...sources.chip import OpenedChip
from ...sources.kind import Request
from . import open_simulated

# A simulation at full speed has no operator who waits for samples, and no host that is late.
SELDOM_S = 0.12


def polled_seldom(plan: Plan, real_time: bool) -> Plan:
    """Return the plan of a session with a simulation that may run at full speed."""
    config = plan.config
    seldom = replace(config, poll_s=min(SELDOM_S, MAX_FRAMES_A_POLL / config.rate_hz))
    return plan if real_time else replace(plan, config=seldom)


def open_source(request: Request) -> OpenedChip:
    """Open the chip that `sim:key=value,...` describes, in the gravity of the plan; see open_simulated."""
    bus = open_simulated(request.value, request.plan.gravity, request.values.get("seed"))
    plan = polled_seldom(request.plan, bus.real_time)
    live, words = bus.real_time, request.words
    return OpenedChip(bus, plan, (bus.hear,), bus.truth_document, words=words, real_time=live, apart=live)
