"""The buses: each moves register reads and writes, and carries the time. Knows no chip's meaning.

A bus is one line of BUSES; its module and the library behind it are imported only when it is asked for.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

from ..errors import UsageError

# name -> module, what opens the bus
BUSES = {
    "bridge": ("mpucal.sources.bridge", "open_bridge"),
    "i2c": ("mpucal.sources.i2c", "I2cBus"),
    "replay": ("mpucal.sources.replay", "ReplayBus"),
    "sim": ("mpucal.simulated.chip", "open_simulated"),
}


def opener(name: str) -> Any:
    """What opens the bus called `name`; its own docstring gives its arguments.

    Raises
    ------
    UsageError : there is no such bus.
    """
    try:
        module, attribute = BUSES[name]
    except KeyError:
        raise UsageError(f"there is no bus called {name}", f"take one of {', '.join(BUSES)}") from None
    return getattr(import_module(module), attribute)
