import io

import numpy as np
import pytest

from mpucal.bridge.frame import Deframer
from mpucal.bridge.messages import Feature, Read
from mpucal.chip import registers as reg
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.errors import BusError, NoAnswer

MS = 1_000_000


@pytest.mark.parametrize(("model", "rate_hz", "latency_ms"), [("mpu6050", 50, 16), ("mpu6500", 1000, 1)])
def test_the_driver_loses_nothing(started, stream, model, rate_hz, latency_ms, check_numbered):
    """An FTDI adapter holds bytes back for 16 ms by default."""
    made, driver = started(model, latency_ms * MS, rate_hz=rate_hz)
    stream(driver, 3)
    driver.stop()
    made.opened.close()
    recording = driver.recording()
    check_numbered(recording, gaps=0)
    assert len(recording) > 2.8 * rate_hz
    assert recording.sensor.rate_hz == pytest.approx(rate_hz * 1.0025, rel=300e-6)


def test_without_streaming_200_hz_work_too(started, stream, check_numbered):
    _, driver = started(latency_ns=16 * MS, features=Feature(0))
    stream(driver, 4)
    recording = driver.recording()
    check_numbered(recording, gaps=0)
    assert len(recording) > 3.5 * 200


def test_long_reads_are_divided_and_too_long_ones_refused(rig):
    bus = rig().bus()
    whole = bus.read(0, 114).data
    assert len(whole) == 114
    assert whole[reg.PWR_MGMT_1] == reg.PWR_MGMT_1_SLEEP
    for too_many in (lambda: bus.read(reg.FIFO_R_W, 4097), lambda: bus.write(0, bytes(33))):
        with pytest.raises(BusError, match="the bridge on the emulated line refuses a request's values"):
            too_many()


def test_a_fifo_started_without_a_reset_is_not_read_ahead(rig):
    bus = rig().bus()
    bus.write(reg.PWR_MGMT_1, bytes([reg.CLKSEL_PLL]))
    bus.write(reg.FIFO_EN, bytes([reg.FIFO_EN_FRAME]))
    t_ns = bus.write(reg.USER_CTRL, bytes([reg.USER_CTRL_FIFO_EN]))
    bus.sleep_until(t_ns + 1000 * MS)
    assert int.from_bytes(bus.read(reg.FIFO_COUNT_H, 2).data, "big") == 1024
    assert bus.read(reg.INT_STATUS, 1).data[0] & reg.INT_FIFO_OFLOW


def test_a_host_that_was_away_catches_up_without_a_gap(started, stream, check_numbered):
    """The chip's FIFO holds 73 ms at 1 kHz, but the host's buffer is larger."""
    made, driver = started(rate_hz=1000)
    stream(driver, 0.5)
    # the host computes, and its port still receives
    for _ in range(4000):
        made.line._step()
    stream(driver, 3)
    recording = driver.recording()
    check_numbered(recording, gaps=0)
    assert len(recording) > 3300


def test_a_missing_chip_is_reported_and_both_addresses_are_tried(rig):
    made = rig()
    made.chip = None
    made.line.device = made.new_bridge()
    with pytest.raises(NoAnswer, match="answers, but no chip answers it at 0x68 or 0x69 on its I2C bus: check"):
        made.bus()
    with pytest.raises(NoAnswer, match="at 0x69 on its"):
        rig().bus(address=0x69)
    assert rig(address=0x69).bus().address == 0x69


def test_a_chip_that_is_disconnected_during_a_stream(started, stream):
    made, driver = started()
    stream(driver, 0.5)

    def nothing(*_):
        raise NoAnswer("nothing acknowledges", "look")

    made.chip.read = made.chip.write = nothing
    with pytest.raises(NoAnswer, match="the chip no longer answers the bridge on the emulated line: check VCC"):
        stream(driver, 5)
    assert len(driver.recording()) > 80


def test_during_a_stream_only_int_enable_is_requested(started, stream):
    """FRAMES hold the overflow flag of INT_STATUS, which a read by the host would clear for the bridge."""
    made, driver = started()
    made.line.written.clear()
    stream(driver, 2)
    asked = {(frame.type, frame.payload) for frame in Deframer().feed(bytes(made.line.written))}
    assert asked == {(Read.TYPE, bytes([reg.INT_ENABLE, 1]))}


@pytest.mark.parametrize(
    ("how", "lost"),
    [({"burst_ns": 450 * MS}, 0.0), ({"latency_ns": 300 * MS}, 0.02)],
    ids=["bursts of 0.45 s", "300 ms, and 2 % of the packets sent again"],
)
def test_a_line_that_delays_replies_makes_no_gap(rig, stream, how, lost, check_numbered):
    made, remarks = rig(line=how), []
    rng, free_ns = np.random.default_rng(1), [0]
    step, coming = made.line._step, made.line._coming

    def sent_again():
        """Delay the packets after a lost one, as TCP does."""
        before = len(coming)
        step()
        if len(coming) > before:
            free_ns[0] = max(free_ns[0], coming[-1].t_ns + 400 * MS * (rng.random() < lost))
            coming[-1] = coming[-1]._replace(t_ns=free_ns[0])

    made.line._step = sent_again
    driver = Driver(made.bus(), Config(rate_hz=200), say=remarks.append)
    driver.start()
    stream(driver, 6)
    recording = driver.recording()
    check_numbered(recording, gaps=0)
    assert len(recording) > 900
    driver.stop()
    assert not any("failed" in sentence for sentence in remarks)


def test_closing_stops_the_stream(rig, stream):
    made = rig()
    bus = made.bus()
    driver = Driver(bus, Config(rate_hz=200))
    driver.start()
    stream(driver, 0.3)
    made.opened.close()
    sent = io.BytesIO()
    for _ in range(2000):
        made.clock.sleep_until(made.clock.now() + MS)
        sent.write(made.line.device.work())
    assert sent.getvalue() == b""
