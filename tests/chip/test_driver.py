"""The driver on the simulated chip, undisturbed and disturbed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.chip import registers as reg
from mpucal.chip.config import Config
from mpucal.chip.decode import decode
from mpucal.chip.driver import Driver
from mpucal.chip.port import TRIES
from mpucal.data import Samples
from mpucal.errors import BusError, BusHeld, ChipError, EndOfCapture, NoAnswer
from mpucal.sources.replay import ReplayBus

CHIPS = ["mpu6050", "mpu6500", "mpu6500_512", "clone98", "icm20690", "icm20602", "mpu6886"]
# accesses of stop()
STOPPING = 2


def test_starting_follows_the_register_map(bench):
    desk = bench("mpu6050")
    sensor = desk.driver().start()
    assert desk.accesses("write") == [
        (register, bytes([value]))
        for register, value in [
            (reg.PWR_MGMT_1, 0x80),
            (reg.SIGNAL_PATH_RESET, 0x07),
            (reg.PWR_MGMT_1, 0x01),
            # how much fits into its FIFO
            (reg.FIFO_EN, 0xF8),
            (reg.USER_CTRL, 0x40),
            (reg.FIFO_EN, 0x00),
            (reg.USER_CTRL, 0x00),
            (reg.PWR_MGMT_2, 0x00),
            (reg.INT_ENABLE, 0x10),
            (reg.SMPLRT_DIV, 4),
            (reg.CONFIG, 3),
            (reg.GYRO_CONFIG, 0x08),
            (reg.ACCEL_CONFIG, 0x08),
            (reg.FIFO_EN, 0x00),
            (reg.USER_CTRL, 0x00),
            (reg.USER_CTRL, 0x04),
            (reg.USER_CTRL, 0x40),
            (reg.FIFO_EN, 0xF8),
        ]
    ]
    assert (sensor.chip, sensor.who_am_i) == ("MPU-6050", 0x68)
    assert (sensor.accel_range_g, sensor.gyro_range_dps, sensor.rate_hz) == (4, 500, 200)


def test_the_reset_and_the_wake_up_get_their_time(bench):
    desk = bench()
    desk.driver().start()
    power = [t for t in desk.transactions if t.register in (reg.PWR_MGMT_1, reg.SIGNAL_PATH_RESET)]
    waits = np.diff([t.t_ns for t in power if t.op == "write"] + [power[-1].t_ns])
    assert len(waits) == 3
    assert (waits >= 100e6).all()


def test_what_stood_in_the_offset_registers_is_read_before_the_reset(bench):
    desk = bench("mpu6500")
    desk.driver().start()
    before = [t for t in desk.transactions if t.op == "read"][1:5]
    assert [(t.register, t.count) for t in before] == [(reg.WHO_AM_I, 1), (0x06, 6), (0x77, 8), (reg.XG_OFFSET_H, 6)]
    assert before[2].data.startswith((-1500).to_bytes(2, "big", signed=True))


@pytest.mark.parametrize("model", CHIPS[1:])
def test_a_6500_gets_its_accelerometer_filter(bench, model):
    desk = bench(model)
    desk.driver(Config(dlpf=2)).start()
    written = [data[0] for register, data in desk.accesses("write") if register == reg.ACCEL_CONFIG2]
    assert written[-1] & ~reg.FIFO_SIZE == 2


@pytest.mark.parametrize("model", ["mpu6500", "mpu6500_512", "clone98", "icm20690"])
def test_the_size_of_a_fifo_is_changed_while_it_stands_still(bench, model):
    desk = bench(model)
    desk.driver().start()
    running, sizes = False, []
    for register, data in desk.accesses("write"):
        if register == reg.USER_CTRL:
            running = bool(data[0] & reg.USER_CTRL_FIFO_EN)
        elif register == reg.ACCEL_CONFIG2:
            assert not running
            sizes.append(data[0] & reg.FIFO_SIZE)
    assert sizes == [reg.FIFO_SIZE, 0 if model == "mpu6500_512" else reg.FIFO_SIZE]


@pytest.mark.parametrize("rate_hz", [50, 200, 1000])
@pytest.mark.parametrize("model", CHIPS)
def test_every_sample_comes_once(bench, stream, numbers, model, rate_hz):
    desk = bench(model)
    driver = desk.driver(Config(rate_hz=rate_hz))
    driver.start()
    samples = stream(driver, 3)
    assert len(samples) == pytest.approx(3 * rate_hz * 1.003, abs=0.1 * rate_hz)
    assert (np.diff(numbers(samples)) == 1).all()
    assert (np.diff(samples.t) > 0).all()
    assert not samples.gap.any()


def test_the_recording_has_the_chips_own_rate_and_temperature(bench, stream):
    driver = bench("mpu6050", rate_error_ppm=-6000.0).driver()
    driver.start()
    stream(driver, 20)
    recording = driver.recording()
    assert recording.sensor.rate_hz == pytest.approx(200 * (1 - 6000e-6), rel=30e-6)
    assert recording.sensor.temperature_c == pytest.approx(-2000 / 340 + 36.53)
    assert np.ptp(np.diff(recording.t)) < 1e-9


@pytest.mark.parametrize("model", CHIPS)
@pytest.mark.parametrize("stall_s", [0.15, 0.5, 10.0])
def test_an_overflow_is_a_gap_and_nothing_worse(bench, stream, numbers, model, stall_s):
    desk = bench(model)
    driver = desk.driver()
    driver.start()
    stream(driver, 0.5)
    desk.stall(stall_s)
    stream(driver, 0.5)
    recording = driver.recording()
    lost = np.diff(numbers(recording)) != 1
    assert recording.gap[1:].tolist() == lost.tolist()
    assert lost.sum() == (stall_s * 200 * 14 > driver.part.fifo_bytes)
    assert np.unique(recording.gyr, axis=0).shape == (1, 3)


def test_times_across_a_gap_are_those_of_the_chip(bench, stream, numbers):
    desk = bench("mpu6050", rate_error_ppm=4000.0)
    driver = desk.driver()
    driver.start()
    stream(driver, 5)
    desk.stall(1.0)
    stream(driver, 5)
    recording = driver.recording()
    line = np.polyfit(numbers(recording), recording.t, 1)
    off_s = recording.t - np.polyval(line, numbers(recording))
    assert np.abs(off_s).max() < 0.2 / 200


def test_an_overflow_while_the_fifo_is_read_is_noticed(bench, stream, numbers):
    desk = bench()
    driver = desk.driver()
    driver.start()
    stream(driver, 0.5)
    desk.before["read", reg.FIFO_R_W] = lambda: (desk.before.clear(), desk.stall(1.0))
    stream(driver, 0.5)
    recording = driver.recording()
    assert recording.gap.sum() == 1
    assert np.unique(recording.gyr, axis=0).shape == (1, 3)
    assert (np.diff(numbers(recording))[~recording.gap[1:]] == 1).all()


def test_misaligned_frames_never_arrive(bench, stream, numbers):
    desk = bench()
    driver = desk.driver()
    driver.start()
    stream(driver, 0.5)
    desk.stall(0.01)
    desk.inner.read(reg.FIFO_R_W, 3)
    stream(driver, 0.5)
    recording = driver.recording()
    assert recording.gap.sum() == 1
    assert np.unique(recording.gyr, axis=0).shape == (1, 3)


def test_a_count_caught_while_the_chip_writes_is_read_again(bench, stream):
    desk = bench()
    driver = desk.driver()
    driver.start()
    odd = iter([5])
    desk.before["answer", reg.FIFO_COUNT_H] = lambda data: bytes([data[0], data[1] + next(odd, 0)])
    stream(driver, 0.5)
    assert not driver.recording().gap.any()


def test_a_failed_fifo_read_is_not_repeated(bench, stream, numbers):
    desk = bench()
    driver = desk.driver()
    driver.start()
    stream(driver, 0.5)
    desk.fail("read", reg.FIFO_R_W, 1)
    before = len(desk.transactions)
    driver.poll()
    after = [t.register for t in desk.transactions[before:]]
    assert after.count(reg.FIFO_R_W) == 1
    assert [t.register for t in desk.transactions if t.op == "write"][-1] == reg.FIFO_EN
    stream(driver, 0.5)
    assert driver.recording().gap.sum() == 1


@pytest.mark.parametrize("times", [1, TRIES - 1, TRIES, 2 * TRIES + 1])
def test_a_count_is_asked_for_until_it_comes(bench, stream, times):
    """It takes nothing from the chip: nothing is lost."""
    desk = bench()
    driver = desk.driver()
    driver.start()
    stream(driver, 0.1)
    desk.fail("read", reg.FIFO_COUNT_H, times)
    stream(driver, 0.5)
    assert not driver.recording().gap.any()


def test_a_status_that_failed_is_not_asked_for_again(bench, stream):
    """Reading clears it: a second read would say that there was no overflow."""
    desk = bench()
    driver = desk.driver()
    driver.start()
    stream(driver, 0.1)
    desk.fail("read", reg.INT_ENABLE, 1)
    before = len(desk.transactions)
    driver.poll()
    status = [t for t in desk.transactions[before:] if t.register == reg.INT_ENABLE]
    assert [t.error is None for t in status] == [False, True]
    assert status[1].count == 1
    stream(driver, 0.5)
    assert driver.recording().gap.sum() == 1


@pytest.mark.parametrize(
    ("kind", "seconds"),
    [(NoAnswer, 2.0), (BusHeld, 0.16), (BusError, 2.0)],
    ids=["nobody answers", "every transfer takes its time-out", "transfers break off"],
)
def test_a_bus_that_stays_dead_is_given_up(bench, stream, kind, seconds):
    desk = bench()
    driver = desk.driver()
    driver.start()
    stream(driver, 0.5)

    def dead():
        raise kind("the wire is off", "plug it in")

    for access in [("read", register) for register in range(128)] + [("write", register) for register in range(128)]:
        desk.before[access] = dead
    begun_ns = driver.now_ns()
    with pytest.raises(kind, match="the wire is off"):
        stream(driver, 10)
    assert driver.now_ns() - begun_ns == pytest.approx(seconds * 1e9, rel=0.15)
    assert len(driver.recording()) > 80


def test_a_bus_that_comes_back_is_used_again(bench, stream, numbers):
    desk = bench()
    driver = desk.driver()
    driver.start()
    stream(driver, 0.5)
    desk.fail("read", reg.FIFO_COUNT_H, 3 * 30)
    stream(driver, 3)
    recording = driver.recording()
    assert recording.gap.sum() == 1
    assert (np.diff(numbers(recording))[~recording.gap[1:]] == 1).all()


def test_nobody_there_is_said_at_once(bench):
    desk = bench()

    def nobody():
        raise NoAnswer("nothing answers at 0x68", "check the wires")

    desk.before["read", reg.WHO_AM_I] = nobody
    with pytest.raises(NoAnswer):
        desk.driver().start()
    assert len(desk.transactions) == TRIES


def test_another_chip_is_refused_before_anything_is_written(bench):
    desk = bench()
    desk.before["answer", reg.WHO_AM_I] = lambda data: b"\xff"
    with pytest.raises(ChipError, match="0xff to WHO_AM_I and has no MPU's registers"):
        desk.driver().start()
    assert not desk.accesses("write")


def test_a_chip_that_stays_asleep(bench):
    desk = bench()
    desk.before["answer", reg.PWR_MGMT_1] = lambda data: b"\x40" + data[1:]
    with pytest.raises(ChipError, match="does not wake up"):
        desk.driver().start()
    assert desk.accesses("write").count((reg.PWR_MGMT_1, b"\x01")) == 5


def test_a_setting_that_is_not_kept(bench):
    desk = bench()
    desk.before["answer", reg.GYRO_CONFIG] = lambda data: b"\x00"
    with pytest.raises(ChipError, match="0x1b of the MPU-6050 reads 0x00 after 0x08"):
        desk.driver().start()


@pytest.mark.parametrize("model", CHIPS)
def test_a_chip_that_was_reset_meanwhile_is_set_up_again(bench, stream, numbers, model):
    desk = bench(model)
    driver = desk.driver()
    driver.start()
    stream(driver, 0.5)
    desk.inner.write(reg.PWR_MGMT_1, b"\x80")
    stream(driver, 2)
    recording = driver.recording()
    assert recording.gap.sum() == 1
    assert np.diff(recording.t).max() < 1.0
    assert (np.diff(numbers(recording))[~recording.gap[1:]] == 1).all()
    assert np.unique(recording.gyr, axis=0).shape == (1, 3)


def test_a_chip_that_loses_its_settings_again_and_again(bench, stream):
    desk = bench()
    driver = desk.driver()
    driver.start()
    stream(driver, 0.5)
    desk.before["answer", reg.INT_ENABLE] = lambda data: b"\0" + data[1:]
    with pytest.raises(ChipError, match="reads 0x00 after 0x10 was written"):
        stream(driver, 20)


def test_another_chip_in_its_place(bench, stream):
    desk = bench()
    driver = desk.driver()
    driver.start()
    desk.inner.write(reg.PWR_MGMT_1, b"\x80")
    desk.before["answer", reg.WHO_AM_I] = lambda data: b"\x70"
    with pytest.raises(ChipError, match="MPU-6050 answers 0x70 to WHO_AM_I now, and 0x68 before"):
        stream(driver, 20)


def test_a_sensor_that_repeats_itself_is_set_up_again_and_never_accepted(bench, stream, numbers):
    desk = bench()
    driver = desk.driver()
    driver.start()
    stream(driver, 0.5)
    frozen = bytes.fromhex("1234 5678 2000 f830 0038 ffb2 005a")
    desk.before["answer", reg.FIFO_R_W] = lambda data: frozen * (len(data) // 14)
    stream(driver, 0.5)
    del desk.before["answer", reg.FIFO_R_W]
    stream(driver, 1)
    recording = driver.recording()
    assert recording.gap.sum() == 1
    assert np.unique(recording.gyr, axis=0).shape == (1, 3)
    assert (reg.PWR_MGMT_1, b"\x80") in desk.accesses("write")[1:]


@pytest.mark.parametrize(
    "dead",
    [
        pytest.param((reg.FIFO_COUNT_H, lambda data: b"\0\0"), id="the FIFO stays empty"),
        pytest.param((reg.FIFO_COUNT_H, lambda data: b"\xff\xff"), id="the FIFO stays full"),
        pytest.param((reg.INT_ENABLE, lambda data: data[:2] + b"\x11" if data[1:] else data), id="always overflowing"),
        pytest.param((reg.TEMP_OUT_H, lambda data: b"\x7f\xff" if len(data) == 2 else data), id="never aligned"),
    ],
)
def test_two_seconds_without_a_sample(bench, stream, dead):
    desk = bench()
    register, answer = dead
    driver = desk.driver()
    driver.start()
    desk.before["answer", register] = answer
    desk.stall(0.8)
    with pytest.raises(ChipError, match="no sample that can be accepted for 2 s"):
        stream(driver, 10)


def test_a_chip_without_a_fifo_is_read_sample_by_sample(bench, stream):
    """The times are those of the reads, and a host that is late leaves a gap."""
    desk = bench()
    desk.before["answer", reg.FIFO_COUNT_H] = lambda data: bytes(len(data))
    driver = desk.driver()
    assert driver.start().rate_hz == 200
    stream(driver, 1)
    desk.stall(0.1)
    stream(driver, 1)
    recording = driver.recording()
    assert recording.gap.sum() == 1
    looks = [t.t_ns for t in desk.transactions if t.op == "read" and len(t.data) == 17]
    assert set(np.round(recording.t * 1e9).astype(int)) < set(looks)
    assert len(recording) > len(looks) - 8
    late = np.flatnonzero(np.diff(recording.t) > 0.05)
    assert (late + 1).tolist() == np.flatnonzero(recording.gap).tolist()
    with pytest.raises(ChipError, match=r"has no FIFO.*--rate 250 or less"):
        desk.driver(Config(rate_hz=1000)).start()


def test_stopping_quiets_the_fifo_and_leaves_the_chip_awake(bench, stream):
    desk = bench()
    driver = desk.driver()
    driver.start()
    driver.stop()
    assert desk.accesses("write")[-2:] == [(reg.FIFO_EN, b"\0"), (reg.USER_CTRL, b"\0")]
    assert desk.inner.read(reg.PWR_MGMT_1, 1).data == b"\x01"


def test_stopping_a_bus_that_is_gone_is_no_failure(bench):
    desk = bench()
    driver = desk.driver()
    driver.start()
    desk.fail("write", reg.FIFO_EN, 100)
    driver.stop()
    assert desk.transactions[-1].error is not None


def test_polling_before_starting_is_a_mistake_of_the_program(bench):
    desk = bench()
    with pytest.raises(RuntimeError, match="before it was started"):
        desk.driver().poll()
    assert not desk.transactions


def test_a_replay_asks_for_the_same_and_gets_the_same(bench, stream, same):
    """Whatever happens meanwhile: a stall, a failed FIFO read, a failed register read, slipped bytes."""
    desk = bench("mpu6500")
    live = desk.driver()
    live.start()
    stream(live, 0.3)
    desk.stall(2.0)
    stream(live, 0.3)
    desk.fail("read", reg.FIFO_R_W, 1)
    stream(live, 0.3)
    desk.fail("read", reg.FIFO_COUNT_H, 2)
    stream(live, 0.3)
    desk.stall(0.01)
    desk.inner.read(reg.FIFO_R_W, 5)
    stream(live, 0.3)
    live.stop()
    bus = ReplayBus(desk.transactions)
    replayed = Driver(bus)
    assert replayed.start().chip == "MPU-6500"
    while bus.unread() > STOPPING:
        replayed.poll()
    replayed.stop()
    assert bus.unread() == 0
    assert same(replayed.recording(), live.recording())
    assert live.recording().gap.sum() == 3


def test_the_end_of_a_capture_leaves_what_was_read(bench, stream, same):
    desk = bench()
    live = desk.driver()
    live.start()
    stream(live, 0.5)
    replayed = Driver(ReplayBus(desk.transactions))
    replayed.start()
    with pytest.raises(EndOfCapture):
        stream(replayed, 10)
    replayed.stop()
    assert same(replayed.recording(), live.recording())


@pytest.mark.parametrize(("rate_hz", "share"), [(200, 0.08), (1000, 0.35)])
def test_share_of_a_400_khz_bus(bench, stream, rate_hz, share):
    """Addresses, register, start, repeated start and stop: 30 bits an access, then 9 a byte."""
    desk = bench()
    driver = desk.driver(Config(rate_hz=rate_hz))
    driver.start()
    desk.transactions.clear()
    stream(driver, 5)
    bits = sum(30 + 9 * t.count for t in desk.transactions)
    seconds = (desk.transactions[-1].t_ns - desk.transactions[0].t_ns) * 1e-9
    assert bits / 400_000 / seconds <= share


@settings(max_examples=40)
@given(
    model=st.sampled_from(CHIPS),
    rate_hz=st.sampled_from([100, 200, 1000]),
    faults=st.lists(
        st.tuples(st.sampled_from(["stall", "slip", "data", "count", "status"]), st.integers(1, 700)),
        max_size=4,
    ),
)
def test_whatever_happens_samples_are_true_in_order_and_gaps_are_marked(
    bench, stream, numbers, same, model, rate_hz, faults
):
    desk = bench(model)
    driver = desk.driver(Config(rate_hz=rate_hz))
    driver.start()
    for fault, amount in faults:
        stream(driver, 0.1)
        if fault == "stall":
            desk.stall(amount * 1e-3)
        elif fault == "slip":
            desk.stall(0.01)
            desk.inner.read(reg.FIFO_R_W, 1 + amount % 13)
        elif fault == "data":
            desk.fail("read", reg.FIFO_R_W, 1)
        else:
            desk.fail("read", {"count": reg.FIFO_COUNT_H, "status": reg.INT_ENABLE}[fault], 1 + amount % 2)
    stream(driver, 0.5)
    recording = driver.recording()
    assert (recording.gyr == recording.gyr[0]).all()
    assert (recording.acc[:, 1:] == recording.acc[0, 1:]).all()
    assert recording.gap[1:].tolist() == (np.diff(numbers(recording)) != 1).tolist()
    assert (np.diff(numbers(recording)) >= 1).all()
    assert (np.diff(recording.t) > 0).all()
    assert same(decode(desk.transactions), recording)


def test_samples_that_are_forgotten_are_the_same_samples(bench):
    """With an overflow amid them, which begins a new segment of the clock's."""

    def polled(forget):
        desk = bench()
        driver = desk.driver()
        driver.start()
        for number in range(40):
            if number == 20:
                desk.clock.spend(3_000_000_000)
            yield driver.poll()
            if forget:
                driver.forget()
                assert not len(driver.recording())

    kept, forgotten = Samples.joined(list(polled(False))), Samples.joined(list(polled(True)))
    assert kept.gap.sum() == 1
    for name in Samples.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(kept, name), getattr(forgotten, name))
