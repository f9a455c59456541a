"""Simulated bus: its time, and the driver on it."""

import numpy as np
import pytest

from mpucal.chip import registers as reg
from mpucal.chip.config import Config
from mpucal.session.events import PromptKind
from mpucal.simulated.chip import open_simulated
from tools.lab.sessions import recorded


def test_transfers_take_their_time_at_400_khz():
    bus = open_simulated()
    assert bus.read(reg.FIFO_R_W, 56).t_ns == 0
    assert bus.write(reg.SMPLRT_DIV, b"\x04") == (27 + 3 + 9 * 56) * 2500
    bus.sleep_until(5_000_000)
    assert bus.read(reg.WHO_AM_I, 1).t_ns == 5_000_000
    bus.sleep_until(1)
    assert bus.read(reg.WHO_AM_I, 1).t_ns == 5_000_000 + 39 * 2500


@pytest.mark.parametrize("chip", ["mpu6050", "mpu6500", "clone98"])
def test_the_driver_reads_the_truth_of_a_board_at_rest(chip):
    bus = open_simulated(f"sim:chip={chip},seed=3,rate_error_ppm=4000", gravity=9.82)
    truth, recording = bus.truth_document(), recorded(bus, Config(), (PromptKind.LAY_FLAT, 15.0))
    assert not recording.gap.any()
    assert recording.rate_hz == pytest.approx(200 * 1.004, rel=2e-4)
    assert recording.temperature_c.mean() == pytest.approx(truth["temperature_c"], abs=0.05)
    flat = recording.t > recording.t[0] + 5
    expected = np.array(truth["D"])[:, 2] * 9.82 + truth["b_a"]
    np.testing.assert_allclose(recording.acc[flat].mean(axis=0), expected, atol=0.006)
    np.testing.assert_allclose(recording.gyr[flat].mean(axis=0), truth["b_omega"], atol=2e-4)
