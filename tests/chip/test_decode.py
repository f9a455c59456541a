"""Captured register accesses to the recording that the driver gave."""

import pytest

from mpucal.chip import registers as reg
from mpucal.chip.access import Transaction
from mpucal.chip.config import Config
from mpucal.chip.decode import Decoder, decode
from mpucal.errors import ChipError, RecordingError


def disturbed(bench, stream, model="mpu6050", config=None):
    """The driver's own recording and what went over the bus, with two gaps."""
    desk = bench(model)
    driver = desk.driver(config)
    driver.start()
    stream(driver, 0.3)
    desk.stall(2.0)
    stream(driver, 0.3)
    desk.fail("read", reg.FIFO_R_W, 1)
    stream(driver, 0.3)
    return driver, desk.transactions


@pytest.mark.parametrize(
    "config",
    [Config(), Config(accel_range_g=16, gyro_range_dps=2000, dlpf=1), Config(rate_hz=1000, poll_s=0.01)],
    ids=["default", "wide", "fast"],
)
@pytest.mark.parametrize("model", ["mpu6050", "mpu6500", "clone98"])
def test_offline_equals_live_to_the_last_bit(bench, stream, same, model, config):
    driver, transactions = disturbed(bench, stream, model, config)
    decoded = decode(transactions)
    assert same(decoded, driver.recording())
    assert decoded.gap.sum() == 2


def test_stopping_changes_nothing(bench, stream, same):
    driver, transactions = disturbed(bench, stream)
    driver.stop()
    assert same(decode(transactions), driver.recording())


def test_a_capture_cut_anywhere_gives_what_came_before(bench, stream):
    _, transactions = disturbed(bench, stream)
    whole, last = decode(transactions), 0
    for end in range(len(transactions)):
        try:
            part = decode(transactions[:end], "cut")
        except RecordingError as error:
            assert last == 0, error
            continue
        assert last <= len(part) <= len(whole)
        assert (part.acc == whole.acc[: len(part)]).all()
        assert (part.gap == whole.gap[: len(part)]).all()
        last = len(part)
    assert last > 0.9 * len(whole)


def test_a_capture_without_its_beginning_says_so(bench, stream):
    _, transactions = disturbed(bench, stream)
    with pytest.raises(RecordingError, match=r"late does not say which chip it is \(register 0x75"):
        decode(transactions[5:], "late")


def test_a_capture_without_samples_says_so():
    with pytest.raises(RecordingError, match="empty holds 0 samples"):
        decode([], "empty")


def without_its_probe(transactions):
    """As the first version of the driver made it: the chip is known by its identity alone."""
    counts = [i for i, t in enumerate(transactions) if t.register == reg.FIFO_COUNT_H]
    started = next(i for i, t in enumerate(transactions) if t.register == reg.USER_CTRL and t.data == b"\x04")
    return [t for i, t in enumerate(transactions) if i not in counts or i > started]


def test_an_older_capture_of_an_unknown_chip_says_so(bench, stream):
    _, transactions = disturbed(bench, stream)
    identity = Transaction("read", reg.WHO_AM_I, 1, b"\x13", 0)
    with pytest.raises(ChipError, match="0x13"):
        decode([identity, identity, *without_its_probe(transactions)[2:]])


@pytest.mark.parametrize("model", ["mpu6050", "mpu6500", "clone98"])
def test_an_older_capture_is_decoded_by_its_identity(bench, stream, same, model):
    driver, transactions = disturbed(bench, stream, model)
    assert same(decode(without_its_probe(transactions)), driver.recording())


def test_two_ranges_in_one_capture_are_refused(bench, stream):
    _, transactions = disturbed(bench, stream)
    _, others = disturbed(bench, stream, config=Config(accel_range_g=8))
    with pytest.raises(RecordingError, match="two ranges or rates"):
        decode(transactions + others)


def test_before_the_fifo_starts_there_is_nothing():
    decoder = Decoder("early")
    assert len(decoder.take()) == len(decoder.recording()) == 0
    assert decoder.recording().name == "early"
