"""Decoder of captured register accesses against the driver's own recording."""

import pytest

from mpucal.chip import registers as reg
from mpucal.chip.access import Transaction
from mpucal.chip.config import Config
from mpucal.chip.decode import decode
from mpucal.errors import ChipError, RecordingError


@pytest.fixture
def disturbed(started, stream):
    """Streams with two gaps: (driver, transactions)."""

    def run(model="mpu6050", config=None):
        rig, driver = started(model, config)
        stream(driver, 0.3)
        rig.stall(2.0)
        stream(driver, 0.3)
        rig.fail("read", reg.FIFO_R_W, 1)
        stream(driver, 0.3)
        return driver, rig.transactions

    return run


def test_a_capture_cut_anywhere_gives_the_samples_before(disturbed):
    _, transactions = disturbed()
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


def test_captures_that_cannot_be_decoded_are_refused(disturbed):
    _, transactions = disturbed()
    _, others = disturbed(config=Config(accel_range_g=8))
    for accesses, message in (
        (transactions[5:], r"late does not say which chip it is \(register 0x75"),
        ([], "late holds 0 samples"),
        (transactions + others, "two ranges or rates"),
    ):
        with pytest.raises(RecordingError, match=message):
            decode(accesses, "late")


def without_its_probe(transactions):
    """Remove the test of the FIFO, which the first version of the driver did not make."""
    counts = [i for i, t in enumerate(transactions) if t.register == reg.FIFO_COUNT_H]
    begun = next(i for i, t in enumerate(transactions) if t.register == reg.USER_CTRL and t.data == b"\x04")
    return [t for i, t in enumerate(transactions) if i not in counts or i > begun]


@pytest.mark.parametrize("model", ["mpu6050", "mpu6500", "clone98"])
def test_an_older_capture_is_decoded_by_its_identity(disturbed, same, model):
    driver, transactions = disturbed(model)
    older = without_its_probe(transactions)
    assert same(decode(older), driver.recording())
    unknown = Transaction("read", reg.WHO_AM_I, 1, b"\x13", 0)
    with pytest.raises(ChipError, match="0x13"):
        decode([unknown, unknown, *older[2:]])
