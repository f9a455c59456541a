"""Writes of a calibration to an emulated bridge's memory: stored and compared, or the old one is kept."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.bridge.sink import BridgeSink
from mpucal.bridge.store import StoredBlob
from mpucal.errors import BusError, WriteBackError
from mpucal.result.calibration import Calibration

OLD = b"an old blob"


class FakeStore:
    """A bridge's memory, whose `fails` names the calls that lose the bridge; `spoils` changes what is stored.

    `stores_first` : a write that fails has stored its blob all the same.
    """

    name = "/dev/ttyUSB0"
    occupied = False

    def __init__(self, blob=OLD, fails=(), spoils=(), stores_first=False, chip=0x68):
        self.blob, self.fails, self.spoils = blob, list(fails), list(spoils)
        self.stores_first, self.chip, self.generation, self.written = stores_first, chip, 7, []

    def _may_fail(self, call):
        if call in self.fails:
            self.fails.remove(call)
            raise BusError("the bridge was reset", "check its cable")

    def greet(self):
        self._may_fail("greet")

    def who_am_i(self):
        self._may_fail("who_am_i")
        return self.chip

    def read(self):
        return None if self.blob is None else StoredBlob(self.generation, self.blob)

    def write(self, blob):
        self.written.append(blob)
        if self.stores_first:
            self.blob = blob
        self._may_fail("write")
        self.blob = self.spoils.pop(0) if self.spoils else blob
        self.generation += 1

    def erase(self):
        self.blob, self.occupied = None, False


@pytest.fixture
def calibration():
    good = Calibration(D=np.eye(3), b_a=np.zeros(3), quality={"verdict": "good"}, created="2024-05-17T09:30:00+00:00")
    return replace(good, sensor=replace(good.sensor, who_am_i=0x68))


@pytest.mark.parametrize(
    ("changes", "store", "words"),
    [
        ({"quality": {"verdict": "refused"}}, {}, "nothing was written: the calibration was refused"),
        ({"D": np.full((3, 3), np.nan)}, {}, "nothing was written: the calibration lacks D or b_a"),
        (
            {},
            {"chip": 0x70},
            "nothing was written to .*: WHO_AM_I of this chip is 0x70, but 0x68 of the calibrated one",
        ),
        ({}, {"fails": ["who_am_i"]}, "nothing was written: the bridge was reset: check its cable"),
    ],
    ids=["refused", "not finite", "another chip", "lost"],
)
def test_an_unfit_calibration_is_refused_before_the_memory_is_written(calibration, changes, store, words):
    held = FakeStore(**store)
    with pytest.raises(WriteBackError, match=words):
        BridgeSink(held).write(replace(calibration, **changes))
    assert (held.blob, held.written) == (OLD, [])


@pytest.mark.parametrize(
    ("store", "words", "left"),
    [
        ({"fails": ["write"]}, "the bridge was reset; it still has the old calibration: check", OLD),
        ({"fails": ["write"], "blob": None}, "the bridge was reset; it still has none", None),
        (
            {"fails": ["write", "greet"]},
            "either the old calibration or the new one, whole: connect it again.*show",
            OLD,
        ),
        ({"spoils": [b"x"]}, "does not read back what was stored; the old calibration is restored", OLD),
        ({"spoils": [b"x"], "blob": None}, "what was stored; it has none, as before", None),
        ({"spoils": [b"x", b"y"]}, "does not accept the old calibration: use another board", b"y"),
    ],
    ids=["reset", "reset, empty", "gone", "spoiled", "spoiled, empty", "worn out"],
)
def test_a_failed_write_keeps_the_old_calibration_and_is_reported(calibration, store, words, left):
    held = FakeStore(**store)
    with pytest.raises(WriteBackError, match=words):
        BridgeSink(held).write(calibration)
    assert held.blob == left


def test_a_reply_that_was_lost_behind_the_commit_is_no_failure(calibration):
    held = FakeStore(fails=["write"], stores_first=True)
    assert "read back and validated" in BridgeSink(held).write(calibration).what
    assert held.blob == calibration.blob().encode()
