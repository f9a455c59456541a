"""Correction of a bridge's clock that is off, live and in a capture."""

import numpy as np
import pytest

from mpucal import load
from mpucal.bridge.bus import BridgeBus
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.doctor.finding import Mark
from mpucal.doctor.measure import examine_stream
from mpucal.files.mcap import CaptureWriter, read_capture
from mpucal.simulated.chip import Chip, SimulatedBus
from mpucal.simulated.chip.bus import FastClock
from mpucal.simulated.chip.models import MODELS, FactoryTrim
from mpucal.sources.opened_source import NewRecords
from mpucal.sources.replay import ReplayBus
from mpucal.sources.tap import Tap
from tools.lab.bridge import EmulatedBridge, EmulatedLine

MS = 1_000_000


class Counting:
    """Different samples of a board that lies flat; their values do not matter here."""

    def __init__(self):
        self._next = 0

    def samples(self, edges_s, setting):
        numbers = np.arange(self._next, self._next + len(edges_s) - 1)
        rows = (numbers[:, None] * [3, 5, 7, 0, 11, 13, 17] % 64).astype(np.int16)
        rows[:, 2] += round(32768 / setting.accel_range_g)
        self._next += len(rows)
        return rows


@pytest.fixture
def recorded(tmp_path):
    """Records behind a bridge whose clock is off: (recording, path of the capture)."""

    def run(seconds, ppm, drift_ppm_a_minute=0.0, burst_ms=1, rate_error_ppm=2500.0, reset_s=None):
        clock = FastClock()
        chip = SimulatedBus(Chip(MODELS["mpu6050"], Counting(), rate_error_ppm, FactoryTrim()), clock)
        drift = 0.5 * drift_ppm_a_minute * 1e-6 / 60 * 1e-9

        def shown():
            t = clock.now()
            return t + round(ppm * 1e-6 * t + drift * t * t)

        def shown_since(begun):
            return lambda: shown() - begun

        line = EmulatedLine(EmulatedBridge(chip, shown), clock, burst_ns=burst_ms * MS, step_ns=2 * MS)
        path = tmp_path / "capture.mcap"
        path.unlink(missing_ok=True)
        bus = BridgeBus(line)
        with CaptureWriter(path) as writer:
            writer.start({})
            driver = Driver(Tap(bus, NewRecords(writer)), Config())
            driver.start()
            while clock.now() < seconds * 1e9:
                if reset_s is not None and clock.now() > reset_s * 1e9:
                    line.device, reset_s = EmulatedBridge(chip, shown_since(shown())), None
                driver.poll()
        return driver.recording(), path

    return run


def test_the_doctor_says_how_far_it_is_off(recorded):
    recording, _ = recorded(20, 7000, burst_ms=16, rate_error_ppm=-3700.0)
    told = {finding.topic: finding for finding in examine_stream(recording, 200.0, 20.0, None)}
    clock = told["bridge's clock"]
    assert (clock.mark, clock.data["ppm"]) == (Mark.NOTE, pytest.approx(7000, abs=40))
    assert told["sample rate"].data["rate_hz"] == pytest.approx(200 * (1 - 3700e-6), rel=60e-6)


@pytest.mark.parametrize(("ppm", "drift", "burst_ms"), [(-10000, 50, 4)])
def test_the_rate_is_known_and_corrected(recorded, ppm, drift, burst_ms):
    recording, _ = recorded(40, ppm, drift, burst_ms)
    sensor = recording.sensor
    assert sensor.clock_std < 60e-6
    assert sensor.clock_ppm == pytest.approx(ppm + drift / 3, abs=4e6 * sensor.clock_std + 2)
    true_hz = 200 * (1 + 2500e-6)
    assert sensor.rate_hz == pytest.approx(true_hz, rel=4 * sensor.clock_std + 20e-6)
    assert recording.rate_hz == pytest.approx(true_hz, rel=100e-6)


def test_frames_in_step_with_an_adapters_bursts_do_no_harm(recorded):
    """Four looks of 20 ms take as long as five bursts of 16 ms: each is later by as much as the chip is slow."""
    recording, *_ = recorded(30, 0, burst_ms=16, rate_error_ppm=-130)
    sensor = recording.sensor
    assert sensor.clock_std < 20e-6
    assert sensor.clock_ppm == pytest.approx(0, abs=min(20, 4e6 * sensor.clock_std))


def test_a_bridge_that_was_reset_keeps_its_rate(recorded):
    recording, *_ = recorded(40, 5000, burst_ms=16, reset_s=15)
    assert recording.gap.sum() == 1
    assert recording.sensor.clock_std < 50e-6
    assert recording.sensor.clock_ppm == pytest.approx(5000, abs=4e6 * recording.sensor.clock_std)


def test_a_capture_keeps_it(recorded):
    """The bridge is reset meanwhile."""
    recording, path = recorded(8, 5000, burst_ms=4, reset_s=3)
    assert recording.gap.sum() == 1
    again = load(path)
    assert np.array_equal(again.t, recording.t)
    assert again.sensor == recording.sensor
    records = read_capture(path).records
    replayed = Driver(ReplayBus(records), Config())
    replayed.start()
    while len(replayed.recording()) < len(recording):
        replayed.poll()
    for name in ("t", "acc", "gyr", "gap"):
        assert np.array_equal(getattr(replayed.recording(), name), getattr(recording, name))
