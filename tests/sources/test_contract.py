"""Contract of a bus, tested on each kind."""

from types import SimpleNamespace

import pytest

from mpucal.bridge import BridgeBus
from mpucal.chip import registers as reg
from mpucal.errors import EndOfCapture
from mpucal.sources.i2c import I2cBus
from mpucal.sources.replay import ReplayBus, Tap
from tools.lab.bridge import EmulatedBridge, EmulatedLine


def script(bus):
    """Make the accesses of all tests here, which a replay must contain; return the data and the times."""
    times, replies = [], []

    def read(register, count):
        reply = bus.read(register, count)
        replies.append(reply.data)
        times.append(reply.t_ns)

    def write(register, data):
        times.append(bus.write(register, data))

    read(reg.WHO_AM_I, 1)
    write(reg.PWR_MGMT_1, bytes([reg.CLKSEL_PLL]))
    write(reg.SMPLRT_DIV, b"\x04\x03\x08\x10")
    read(reg.SMPLRT_DIV, 4)
    write(reg.FIFO_EN, bytes([reg.FIFO_EN_FRAME]))
    write(reg.USER_CTRL, bytes([reg.USER_CTRL_FIFO_EN]))
    bus.sleep_until(times[-1] + 50_000_000)
    read(reg.FIFO_COUNT_H, 2)
    read(reg.FIFO_R_W, 28)
    read(reg.FIFO_COUNT_H, 2)
    return SimpleNamespace(times=times, replies=replies)


@pytest.fixture(params=["bridge", "i2c", "sim", "replay", "tap"])
def bus(request, adapter, still_chip):
    accesses = []
    if request.param == "i2c":
        return I2cBus(str(adapter().path))
    simulated, clock = still_chip()
    if request.param == "bridge":
        return BridgeBus(EmulatedLine(EmulatedBridge(simulated, clock.now), clock))
    if request.param == "sim":
        return simulated
    if request.param == "tap":
        return Tap(simulated, accesses.append)
    script(Tap(simulated, accesses.append))
    return ReplayBus(accesses)


def test_registers_are_kept_the_fifo_does_not_increment_and_time_never_goes_back(bus):
    done = script(bus)
    replies, times = done.replies, done.times
    assert {type(reply) for reply in replies} == {bytes}
    assert replies[:2] == [b"\x68", b"\x04\x03\x08\x10"]
    before, data, after = replies[2:]
    held, left = (int.from_bytes(count, "big") for count in (before, after))
    accel = (12).to_bytes(2, "big") + (-34).to_bytes(2, "big", signed=True)
    assert [data[i : i + 4] for i in (0, 14)] == [accel, accel]
    assert len(data) == 28
    assert held in range(9 * 14, 11 * 14)
    assert left in (held - 28, held - 14)
    assert times == sorted(times)
    assert times[-3] - times[-4] >= 50_000_000
    assert all(isinstance(t, int) for t in times)
    if isinstance(bus, ReplayBus):
        with pytest.raises(EndOfCapture):
            bus.read(reg.WHO_AM_I, 1)
    bus.close()
