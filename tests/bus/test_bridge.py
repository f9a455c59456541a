"""A chip behind an emulated bridge, on a line whose time runs only while the host waits."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpucal.bus.bridge.bus import BridgeBus
from mpucal.bus.bridge.emulated import EmulatedBridge, EmulatedLine
from mpucal.bus.simulated import SimulatedBus
from mpucal.bus.simulated.chip import Chip
from mpucal.bus.simulated.clock import FastClock
from mpucal.bus.simulated.factory import Factory
from mpucal.bus.simulated.models import MODELS
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver

MS = 1_000_000


class NumberedFeed:
    """Samples 0, 1, 2, ... in accelerometer x; every other word is the same in all."""

    def __init__(self):
        self.next = 0

    def samples(self, edges_s, setting):
        n = len(edges_s) - 1
        rows = np.tile(np.array([0, -34, 8192, -2000, 56, -78, 90], np.int16), (n, 1))
        rows[:, 0] = np.arange(self.next, self.next + n) % 30000
        self.next += n
        return rows


@pytest.fixture
def rig():
    """Makes a line to an emulated bridge with a chip: its parts by name."""

    def make(model="mpu6050", latency_ns=MS, **how):
        clock = FastClock()
        chip = SimulatedBus(Chip(MODELS[model], NumberedFeed(), 2500.0, Factory()), clock)
        line = EmulatedLine(EmulatedBridge(chip, clock.now, **how), clock, latency_ns)
        return SimpleNamespace(clock=clock, chip=chip, line=line)

    return make


@pytest.mark.parametrize("latency_ms", [1, 16])
@pytest.mark.parametrize("model", ["mpu6050", "mpu6500", "clone98"])
@pytest.mark.parametrize("rate_hz", [50, 200, 1000])
def test_the_driver_runs_through_it_and_nothing_is_lost(rig, model, rate_hz, latency_ms):
    """16 ms is what an FTDI adapter holds bytes back by default."""
    bus = BridgeBus(rig(model, latency_ms * MS).line)
    driver = Driver(bus, Config(rate_hz=rate_hz))
    driver.start()
    begun_ns = driver.now_ns()
    while driver.now_ns() < begun_ns + 4e9:
        driver.poll()
    driver.stop()
    bus.close()
    recording = driver.recording()
    numbers = np.rint(recording.acc[:, 0] / recording.acc[0, 2] * 8192).astype(int)
    assert not recording.gap.any()
    assert set(np.diff(numbers)) == {1}
    assert len(recording) > 3.8 * rate_hz
    assert recording.sensor.rate_hz == pytest.approx(rate_hz * 1.0025, rel=300e-6)
