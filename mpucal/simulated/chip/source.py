"""Simulated chip as a source, which `--bus sim` opens."""

from __future__ import annotations

from dataclasses import replace

from ...chip.config import MAX_FRAMES_A_POLL
from ...sources.chip import OpenedChip
from ...sources.kind import Request
from . import open_simulated

# A simulation at full speed has no operator who waits for samples, and no host that is late.
SELDOM_S = 0.12


def open_source(request: Request) -> OpenedChip:
    """Open the chip that `sim:key=value,...` describes, in the gravity of the plan; see open_simulated."""
    bus = open_simulated(request.value, request.plan.gravity, request.values.get("seed"))
    config = request.plan.config
    seldom = replace(config, poll_s=min(SELDOM_S, MAX_FRAMES_A_POLL / config.rate_hz))
    plan = request.plan if bus.real_time else replace(request.plan, config=seldom)
    live, words = bus.real_time, request.words
    return OpenedChip(bus, plan, (bus.hear,), bus.truth_document, words=words, real_time=live, apart=live)
