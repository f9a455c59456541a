"""Correction of a bridge's clock that is off, live and in a capture."""

from contextlib import suppress

import numpy as np
import pytest

from mpucal import load
from mpucal.bridge.bus import BridgeBus
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.doctor.finding import Mark
from mpucal.doctor.measure import examine_stream
from mpucal.files.capture_writer import CaptureWriter
from mpucal.files.mcap import read_capture
from mpucal.simulated.chip import Chip, SimulatedBus
from mpucal.simulated.chip.bus import FastClock
from mpucal.simulated.chip.models import MODELS, FactoryTrim
from mpucal.sources.opened_source import CaptureRecorder
from mpucal.sources.replay import EndOfCapture, ReplayBus, Tap
from tools.lab.bridge import EmulatedBridge, EmulatedLine
from tools.lab.feeds import NumberedFeed

MS = 1_000_000


@pytest.fixture
def recorded(tmp_path):
    """Records behind a bridge whose clock is off: (recording, path of the capture)."""

    def run(seconds, ppm, drift_ppm_a_minute=0.0, burst_ms=1, rate_error_ppm=2500.0, reset_s=None):
        clock = FastClock()
        chip = SimulatedBus(Chip(MODELS["mpu6050"], NumberedFeed(), rate_error_ppm, FactoryTrim()), clock)
        drift = 0.5 * drift_ppm_a_minute * 1e-6 / 60 * 1e-9

        def shown():
            t = clock.now()
            return t + round(ppm * 1e-6 * t + drift * t * t)

        line = EmulatedLine(EmulatedBridge(chip, shown), clock, burst_ns=burst_ms * MS, step_ns=2 * MS)
        path = tmp_path / "capture.mcap"
        with CaptureWriter(path) as writer:
            writer.start({})
            driver = Driver(Tap(BridgeBus(line), CaptureRecorder(writer).transaction), Config())
            driver.start()
            while clock.now() < seconds * 1e9:
                if reset_s is not None and clock.now() > reset_s * 1e9:
                    begun, reset_s = shown(), None
                    line.device = EmulatedBridge(chip, lambda begun=begun: shown() - begun)
                driver.poll()
        return driver.recording(), path

    return run


def test_the_rate_is_known_and_corrected_and_the_doctor_says_how_far_it_is_off(recorded):
    recording, _ = recorded(20, -10000, drift_ppm_a_minute=50, burst_ms=4)
    sensor = recording.sensor
    assert sensor.clock_std < 60e-6
    assert sensor.clock_ppm == pytest.approx(-10000 + 50 / 6, abs=4e6 * sensor.clock_std + 2)
    true_hz = 200 * (1 + 2500e-6)
    assert sensor.rate_hz == pytest.approx(true_hz, rel=4 * sensor.clock_std + 20e-6)
    assert recording.rate_hz == pytest.approx(true_hz, rel=100e-6)
    findings = {finding.topic: finding for finding in examine_stream(recording, 200.0, 20.0, None, "")}
    assert (findings["bridge's clock"].mark, findings["bridge's clock"].data["ppm"]) == (Mark.NOTE, sensor.clock_ppm)
    assert findings["sample rate"].data["rate_hz"] == sensor.rate_hz


def test_frames_in_step_with_an_adapters_bursts_do_no_harm(recorded):
    """Four polls of 20 ms take as long as five bursts of 16 ms: delays vary as slowly as the chip is off."""
    recording, _ = recorded(30, 0, burst_ms=16, rate_error_ppm=-130)
    sensor = recording.sensor
    assert sensor.clock_std < 20e-6
    assert sensor.clock_ppm == pytest.approx(0, abs=min(20, 4e6 * sensor.clock_std))


def test_a_bridge_that_was_reset_keeps_its_rate_and_a_capture_has_it(recorded):
    recording, path = recorded(18, 5000, burst_ms=16, reset_s=9)
    sensor = recording.sensor
    assert recording.gap.sum() == 1
    assert sensor.clock_std < 100e-6
    assert sensor.clock_ppm == pytest.approx(5000, abs=4e6 * sensor.clock_std)
    again = load(path)
    assert np.array_equal(again.t, recording.t)
    assert again.sensor == sensor
    replayed = Driver(ReplayBus(read_capture(path).records), Config())
    replayed.start()
    with suppress(EndOfCapture):
        while True:
            replayed.poll()
    for name in ("t", "acc", "gyr", "gap"):
        assert np.array_equal(getattr(replayed.recording(), name), getattr(recording, name))
