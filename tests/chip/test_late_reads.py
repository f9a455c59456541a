"""Pauses of this computer between the time of a read and its transfer: late times are not used, and are counted."""

import numpy as np
import pytest

from mpucal.chip import registers as reg
from mpucal.chip.config import Config
from mpucal.chip.decode import decode
from mpucal.chip.driver import Driver
from mpucal.errors import EndOfCapture
from mpucal.sources.read_timer import LATE_NS, ReadTimer
from mpucal.sources.replay import ReplayBus

CONFIG = Config(rate_hz=200.0)


@pytest.fixture
def paused(rig, monkeypatch):
    """Makes a rig whose host is paused before transfers, as `draw` says [s], and returns it with its samples' times."""

    def make(draw, model="mpu6050"):
        made, times_s = rig(model), []
        timer, feed = ReadTimer(made.clock.now), made.chip._feed
        read, samples = made.inner.read, feed.samples

        def transfer(register, count):
            made.stall(draw(register, made.clock.now() * 1e-9))
            return read(register, count).data

        def timed(edges_s, setting):
            times_s.extend(edges_s[1:])
            return samples(edges_s, setting)

        monkeypatch.setattr(feed, "samples", timed)
        monkeypatch.setattr(
            made.inner, "read", lambda register, count: timer.read(register, count, lambda: transfer(register, count))
        )
        return made, times_s

    return make


def often(seed):
    """Pause most reads of the FIFO's count, once the chip has started."""
    rng = np.random.default_rng(seed)
    pauses = lambda register, now_s: register == reg.FIFO_COUNT_H and now_s > 1.0 and rng.random() < 0.7  # noqa: E731
    return lambda register, now_s: rng.uniform(3e-3, 30e-3) if pauses(register, now_s) else 0.0


@pytest.mark.parametrize("model", ["mpu6050", "mpu6500"])
def test_every_time_is_right_whatever_is_paused(paused, stream, numbers, same, model):
    made, times_s = paused(often(1), model)
    driver = made.driver(CONFIG)
    driver.start()
    stream(driver, 3)
    # A read that broke off begins a segment; the shortest ones have a single time.
    for _ in range(40):
        made.fail("read", reg.FIFO_R_W, 1)
        stream(driver, 0.1)
    recording = driver.recording()
    early_s = np.array(times_s)[numbers(recording)] - recording.t
    assert abs(early_s - np.median(early_s)).max() < LATE_NS * 1e-9 + 0.5 / CONFIG.rate_hz
    late = [each for each in made.transactions if each.error is not None and each.error.name == "LateRead"]
    assert {each.register for each in late} == {reg.FIFO_COUNT_H}
    assert same(decode(made.transactions), recording)
    replayed = Driver(ReplayBus(made.transactions), CONFIG)
    replayed.start()
    with pytest.raises(EndOfCapture):
        stream(replayed, 99)
    assert same(replayed.recording(), recording)
