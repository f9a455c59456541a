"""Driver on the simulated chip, undisturbed and disturbed."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mpucal.chip import registers as reg
from mpucal.chip.config import Config
from mpucal.chip.decode import decode
from mpucal.chip.driver import TIMED_READS, Driver
from mpucal.chip.port import TRIES
from mpucal.data import Samples
from mpucal.errors import BusError, BusHeld, ChipError, EndOfCapture, NoAnswer, UsageError
from mpucal.simulated.chip import open_simulated
from mpucal.sources.host_bus import LATE_NS, HostBus
from mpucal.sources.replay import ReplayBus
from tools.lab.feeds import numbers

CHIPS = ["mpu6050", "mpu6500", "mpu6500_512", "clone98", "icm20690", "icm20602", "mpu6886"]
FAST = Config(rate_hz=1000)
# accesses of stop()
STOPPING = 2


def test_a_start_resets_the_chip_and_waits_as_its_register_map_asks(started):
    rig, driver = started("mpu6050")
    resets = [(reg.PWR_MGMT_1, b"\x80"), (reg.SIGNAL_PATH_RESET, b"\x07"), (reg.PWR_MGMT_1, b"\x01")]
    assert rig.writes()[:3] == resets
    assert rig.writes()[-2:] == [(reg.USER_CTRL, b"\x40"), (reg.FIFO_EN, b"\xf8")]
    power = [t for t in rig.transactions if t.register in (reg.PWR_MGMT_1, reg.SIGNAL_PATH_RESET)]
    waits = np.diff([t.t_ns for t in power if t.op == "write"] + [power[-1].t_ns])
    assert len(waits) == 3
    assert (waits >= 100e6).all()
    sensor = driver.recording().sensor
    assert (sensor.chip, sensor.who_am_i) == ("MPU-6050", 0x68)
    assert (sensor.accel_range_g, sensor.gyro_range_dps, sensor.rate_hz) == (4, 500, 200)
    # corrections that the reset removes
    before = [(t.register, t.count) for t in rig.transactions if t.op == "read"]
    assert before.index((0x06, 6)) < before.index((reg.XG_OFFSET_H, 6))
    # the chip is left awake, with its FIFO stopped; a dead bus leaves it unchanged
    driver.stop()
    assert rig.writes()[-2:] == [(reg.FIFO_EN, b"\0"), (reg.USER_CTRL, b"\0")]
    assert rig.inner.read(reg.PWR_MGMT_1, 1).data == b"\x01"
    rig.fail("write", reg.FIFO_EN, 100)
    driver.stop()
    assert rig.transactions[-1].error is not None


@pytest.mark.parametrize("model", CHIPS)
def test_every_sample_comes_once(started, stream, model, check_numbered):
    """Count the bits on the bus, too: 30 of each access beside its bytes, of 9 bits each."""
    rig, driver = started(model, Config(rate_hz=1000))
    rig.transactions.clear()
    samples = stream(driver, 1.0)
    assert len(samples) == pytest.approx(1003, abs=100)
    check_numbered(samples, gaps=0)
    bits = sum(30 + 9 * t.count for t in rig.transactions)
    assert bits / 400_000 / (rig.transactions[-1].t_ns - rig.transactions[0].t_ns) * 1e9 <= 0.35


@pytest.mark.parametrize("times", [TRIES - 1, 2 * TRIES + 1])
def test_a_count_that_failed_or_was_read_within_a_frame_is_read_again(started, stream, times):
    rig, driver = started()
    odd = iter([5])
    rig.before["answer", reg.FIFO_COUNT_H] = lambda data: bytes([data[0], data[1] + next(odd, 0)])
    stream(driver, 0.1)
    rig.fail("read", reg.FIFO_COUNT_H, times)
    stream(driver, 0.5)
    assert not driver.recording().gap.any()


@pytest.mark.parametrize("register", [reg.FIFO_R_W, reg.INT_ENABLE], ids=["FIFO", "status"])
def test_a_failed_destructive_read_is_not_repeated(started, stream, register, check_numbered):
    """A second read of the FIFO would begin within a frame; one of the status would not show an overflow."""
    rig, driver = started()
    stream(driver, 0.5)
    rig.fail("read", register, 1)
    before = len(rig.transactions)
    driver.poll()
    reads = [t for t in rig.transactions[before:] if t.register == register and t.count > 1]
    assert [t.error is None for t in reads] == [False]
    assert rig.writes()[-1][0] == reg.FIFO_EN
    stream(driver, 0.5)
    check_numbered(driver.recording(), gaps=1)


@pytest.mark.parametrize(
    ("kind", "seconds"),
    [(NoAnswer, 2.0), (BusHeld, 0.16), (BusError, 2.0)],
    ids=["no acknowledge", "every transfer times out", "transfers break off"],
)
def test_a_bus_that_stays_dead_is_given_up(started, stream, kind, seconds):
    rig, driver = started()
    stream(driver, 0.5)

    def dead():
        raise kind("the wire is off", "plug it in")

    rig.before = {(op, register): dead for op in ("read", "write") for register in range(128)}
    begun_ns = driver.now_ns()
    with pytest.raises(kind, match="the wire is off"):
        stream(driver, 10)
    assert driver.now_ns() - begun_ns == pytest.approx(seconds * 1e9, rel=0.15)
    assert len(driver.recording()) > 80


@pytest.mark.parametrize(
    ("register", "answer", "message", "wakes"),
    [
        pytest.param(
            reg.WHO_AM_I, lambda data: b"\xff", "0xff to WHO_AM_I and does not have an MPU's registers", 0, id="foreign"
        ),
        pytest.param(reg.PWR_MGMT_1, lambda data: b"\x40" + data[1:], "does not wake up", 5, id="asleep"),
        pytest.param(
            reg.GYRO_CONFIG, lambda data: b"\x00", "0x1b of the MPU-6050 reads 0x00 after 0x08", 1, id="setting lost"
        ),
    ],
)
def test_a_chip_that_does_not_start(rig, register, answer, message, wakes):
    rig = rig()
    rig.before["answer", register] = answer
    with pytest.raises(ChipError, match=message):
        rig.driver().start()
    assert rig.writes().count((reg.PWR_MGMT_1, b"\x01")) == wakes
    assert bool(rig.writes()) == bool(wakes)


@pytest.mark.parametrize(
    ("register", "answer", "message"),
    [
        pytest.param(
            reg.INT_ENABLE, lambda data: b"\0" + data[1:], "reads 0x00 after 0x10 was written", id="settings lost"
        ),
        pytest.param(
            reg.WHO_AM_I,
            lambda data: b"\x70",
            "MPU-6050 answers 0x70 to WHO_AM_I now, and answered 0x68 before",
            id="another chip in its place",
        ),
    ],
)
def test_a_reset_chip_that_cannot_be_set_up_again(started, stream, register, answer, message):
    rig, driver = started()
    stream(driver, 0.5)
    rig.inner.write(reg.PWR_MGMT_1, b"\x80")
    rig.before["answer", register] = answer
    with pytest.raises(ChipError, match=message):
        stream(driver, 20)


@pytest.mark.parametrize(
    ("register", "answer"),
    [
        pytest.param(reg.FIFO_COUNT_H, lambda data: b"\0\0", id="the FIFO stays empty"),
        pytest.param(reg.FIFO_COUNT_H, lambda data: b"\xff\xff", id="the FIFO stays full"),
        pytest.param(reg.INT_ENABLE, lambda data: data[:2] + b"\x11" if data[1:] else data, id="always overflowing"),
        pytest.param(reg.TEMP_OUT_H, lambda data: b"\x7f\xff" if len(data) == 2 else data, id="never aligned"),
    ],
)
def test_two_seconds_without_a_sample(started, stream, register, answer):
    rig, driver = started()
    rig.before["answer", register] = answer
    rig.stall(0.8)
    with pytest.raises(ChipError, match="no valid sample for 2 s"):
        stream(driver, 10)


def test_a_chip_without_a_fifo_is_read_sample_by_sample(rig, stream):
    """The times are those of the reads, and a host that is late leaves a gap."""
    rig = rig()
    rig.before["answer", reg.FIFO_COUNT_H] = lambda data: bytes(len(data))
    driver = rig.driver()
    assert driver.start().rate_hz == 200
    stream(driver, 1)
    rig.stall(0.1)
    stream(driver, 1)
    recording = driver.recording()
    assert recording.gap.sum() == 1
    reads_ns = [t.t_ns for t in rig.transactions if t.op == "read" and len(t.data) == 17]
    assert set(np.round(recording.t * 1e9).astype(int)) < set(reads_ns)
    assert len(recording) > len(reads_ns) - 8
    late = np.flatnonzero(np.diff(recording.t) > 0.05)
    assert (late + 1).tolist() == np.flatnonzero(recording.gap).tolist()
    with pytest.raises(ChipError, match=r"has no FIFO.*--rate 250 or less"):
        rig.driver(Config(rate_hz=1000)).start()


def test_a_replay_makes_the_same_accesses_and_samples(started, stream, same):
    rig, live = started("mpu6500")
    for disturb in (
        lambda: rig.stall(2.0),
        lambda: rig.fail("read", reg.FIFO_R_W, 1),
        lambda: rig.fail("read", reg.FIFO_COUNT_H, 2),
        lambda: rig.slip(5),
    ):
        stream(live, 0.3)
        disturb()
    stream(live, 0.3)
    cut = Driver(ReplayBus(list(rig.transactions)))
    cut.start()
    with pytest.raises(EndOfCapture):
        stream(cut, 10)
    cut.stop()
    live.stop()
    bus = ReplayBus(rig.transactions)
    replayed = Driver(bus)
    assert replayed.start().chip == "MPU-6500"
    while bus.unread() > STOPPING:
        replayed.poll()
    replayed.stop()
    assert bus.unread() == 0
    assert same(replayed.recording(), live.recording())
    assert same(cut.recording(), live.recording())
    assert live.recording().gap.sum() == 3


@settings(max_examples=25)
@given(
    model=st.sampled_from(CHIPS),
    rate_hz=st.sampled_from([100, 200, 1000]),
    faults=st.lists(
        st.tuples(st.sampled_from(["stall", "slip", "data", "count", "status", "reset"]), st.integers(1, 700)),
        max_size=4,
    ),
)
@example("mpu6500", 1000, [("slip", 4), ("stall", 700), ("data", 1), ("reset", 1)])
@example("mpu6050", 200, [("slip", 4), ("stall", 700), ("data", 1), ("reset", 1)])
def test_after_any_faults_samples_are_true_and_gaps_are_marked(
    started, stream, same, check_numbered, model, rate_hz, faults
):
    rig, driver = started(model, Config(rate_hz=rate_hz))
    registers = {"data": reg.FIFO_R_W, "count": reg.FIFO_COUNT_H, "status": reg.INT_ENABLE}
    for fault, amount in faults:
        stream(driver, 0.1)
        if fault == "stall":
            rig.stall(amount * 1e-3)
        elif fault == "slip":
            rig.slip(1 + amount % 13)
        elif fault == "reset":
            rig.inner.write(reg.PWR_MGMT_1, b"\x80")
        else:
            rig.fail("read", registers[fault], 1 if fault == "data" else 1 + amount % 2)
    stream(driver, 0.5)
    check_numbered(driver.recording())
    assert same(decode(rig.transactions), driver.recording())


def test_forgetting_does_not_change_the_samples(started):
    """An overflow among them begins a new segment of the clock."""

    def polled(forget):
        rig, driver = started()
        for number in range(40):
            if number == 20:
                rig.stall(3)
            yield driver.poll()
            if forget:
                driver.forget()
                assert not len(driver.recording())

    kept, forgotten = Samples.joined(list(polled(False))), Samples.joined(list(polled(True)))
    assert kept.gap.sum() == 1
    assert kept == forgotten


def test_a_rate_that_the_chip_does_not_have_is_refused(started):
    with pytest.raises(UsageError, match=r"no sample rate of 4000 Hz with its low-pass filter at 3: use 1000 Hz"):
        Config(rate_hz=4000)
    started("mpu6050", Config(dlpf=0))
    with pytest.raises(ChipError, match=r"takes 8000 samples a second with its filter at 0: set the filter to 1 to 6"):
        started("mpu6500", Config(dlpf=0))


def test_a_bus_that_is_too_slow_is_reported(stream):
    driver = Driver(open_simulated("sim:chip=mpu6500,hand=still,khz=100"), FAST)
    driver.start()
    with pytest.raises(BusError, match=r"the bus moves \d+ samples a second, but .*: run the bus at 400 kHz"):
        stream(driver, 10)


def test_a_late_host_does_not_count_as_a_slow_bus(started):
    rig, driver = started("mpu6500", FAST)
    for _ in range(10):
        driver.poll()
        rig.stall(0.4)
        driver.poll()
        driver.poll()
    assert driver.recording().gap.sum() == 10


def test_times_are_right_whichever_read_is_paused(rig, stream, same, monkeypatch):
    """Pause this computer between the time of a read and its transfer: times that are too early are not used."""
    made, times_s, rng = rig(), [], np.random.default_rng(1)
    timer, feed = HostBus(), made.chip._feed
    timer.now_ns = made.clock.now
    read, samples = made.inner.read, feed.samples

    def transfer(register, count):
        if register == reg.FIFO_COUNT_H and made.clock.now() > 1e9 and rng.random() < 0.7:
            made.stall(rng.uniform(3e-3, 30e-3))
        return read(register, count).data

    def timed(edges_s, setting):
        times_s.extend(edges_s[1:])
        return samples(edges_s, setting)

    monkeypatch.setattr(feed, "samples", timed)

    def timed_read(register, count):
        matters = (register, count) in TIMED_READS
        return timer.timed_read(register, count, matters, lambda: transfer(register, count))

    monkeypatch.setattr(made.inner, "read", timed_read)
    driver = made.driver()
    driver.start()
    stream(driver, 3)
    # A read that broke off begins a segment; the shortest ones have a single time.
    for _ in range(40):
        made.fail("read", reg.FIFO_R_W, 1)
        stream(driver, 0.1)
    recording = driver.recording()
    early_s = np.array(times_s)[numbers(recording)] - recording.t
    assert abs(early_s - np.median(early_s)).max() < LATE_NS * 1e-9 + 0.5 / 200
    late = [each for each in made.transactions if each.error is not None and each.error.name == "LateRead"]
    assert {each.register for each in late} == {reg.FIFO_COUNT_H}
    assert same(decode(made.transactions), recording)
    replayed = Driver(ReplayBus(made.transactions))
    replayed.start()
    with pytest.raises(EndOfCapture):
        stream(replayed, 99)
    assert same(replayed.recording(), recording)
