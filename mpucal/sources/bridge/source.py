"""Source that `--serial` opens: a chip behind a serial bridge."""

from __future__ import annotations

from ...errors import UsageError
from ..chip import OpenedChip
from ..kind import Request
from . import open_bridge


def open_source(request: Request) -> OpenedChip:
    """Open the chip behind the bridge on a port; see open_bridge.

    Raises
    ------
    UsageError : the requested rate is more than a serial line can carry.
    """
    config = request.plan.config
    if config.accel_only:
        raise UsageError(
            f"a bridge cannot carry {config.rate_hz:g} samples a second",
            "use --rate 1000 or less, or connect the chip to an I2C bus of this computer",
        )
    bridge = open_bridge(request.value, request.values.get("address"), request.values.get("micropython"))
    return OpenedChip(bridge, request.plan, words=request.words)
