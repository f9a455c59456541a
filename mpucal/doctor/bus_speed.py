"""Speed of an I2C bus, from the times of its replies."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..chip import registers as reg
from ..chip.access import Bus
from ..errors import BusError
from .finding import Finding, Mark

LONG_BYTES, SHORT_BYTES, READS = 55, 2, 25
SLOW_HZ = 300_000
# The difference of both reads at 1.6 MHz. A smaller one is no I2C bus's: these chips stop at 1 MHz.
LEAST_MS = 0.3
SLOW = "100 kHz is too slow for 1000 samples/s: `dtparam=i2c_arm_baudrate=400000` on a Raspberry Pi"


def examine_speed(bus: Bus) -> Iterator[Finding]:
    """Measure the speed of an I2C bus from the time of 53 bytes more, of nine bits each.

    Raises
    ------
    BusError : a transfer failed.
    """
    short_ms, long_ms = (median_ms(bus, count) for count in (SHORT_BYTES, LONG_BYTES))
    times_ms = {"read_2_bytes_ms": short_ms, "read_55_bytes_ms": long_ms}
    if long_ms - short_ms < LEAST_MS:
        longer = max(long_ms - short_ms, 0.0)
        what = f"not measurable: {LONG_BYTES - SHORT_BYTES} bytes more take only {longer:.2f} ms, as behind USB"
        yield Finding("bus speed", Mark.UNKNOWN, what, "", times_ms)
        return
    hz = 9e3 * (LONG_BYTES - SHORT_BYTES) / (long_ms - short_ms)
    what = f"{hz / 1000:.0f} kHz measured; a read of 14 bytes takes {short_ms + 12 * 9e3 / hz:.2f} ms"
    yield Finding.check("bus speed", hz >= SLOW_HZ, what, SLOW, {"achieved_hz": hz, **times_ms})


def median_ms(bus: Bus, count: int) -> float:
    """Return the median time [ms] from one read of `count` bytes to the next; single reads may fail.

    Raises
    ------
    BusError : no two reads in a row succeed.
    """
    times: list[float] = []
    for _ in range(READS + 1):
        try:
            times.append(float(bus.read(reg.ACCEL_XOUT_H, count).t_ns))
        except BusError as error:
            times.append(np.nan)
            last = error
    steps = np.diff(times)
    if not np.isfinite(steps).any():
        raise last
    return float(np.nanmedian(steps)) / 1e6
