"""Simulated bus: its time."""

from mpucal.chip import registers as reg
from mpucal.simulated.chip import open_simulated


def test_transfers_take_their_time_at_400_khz():
    bus = open_simulated()
    assert bus.read(reg.FIFO_R_W, 56).t_ns == 0
    assert bus.write(reg.SMPLRT_DIV, b"\x04") == (27 + 3 + 9 * 56) * 2500
    bus.sleep_until(5_000_000)
    assert bus.read(reg.WHO_AM_I, 1).t_ns == 5_000_000
    bus.sleep_until(1)
    assert bus.read(reg.WHO_AM_I, 1).t_ns == 5_000_000 + 39 * 2500
