"""The clock of an emulated bridge, as its messages carry it. Reads none."""

from __future__ import annotations

from ..clock import US, WRAP_US


def t_us(t_ns: int) -> int:
    """Microseconds, modulo 2**32."""
    return t_ns // US % WRAP_US
