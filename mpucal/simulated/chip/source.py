"""The simulated chip as a source: what `--bus sim` opens."""

from __future__ import annotations

from ...sources.chip import OpenedChip
from ...sources.kind import Request
from . import open_simulated


def open_source(request: Request) -> OpenedChip:
    """The chip that `sim:key=value,...` describes, in the gravity of the plan; see open_simulated."""
    bus = open_simulated(request.value, request.plan.gravity, request.values.get("seed"))
    return OpenedChip(
        bus, request.plan, (bus.hear,), bus.truth_document(), words=request.words, real_time=bus.real_time
    )
