"""A read that was delayed by a pause of the process is repeated, or fails: its time would be early by the pause."""

from itertools import count

import pytest

from mpucal.chip import registers as reg
from mpucal.chip.driver import SAMPLE_BYTES, STATUS_BYTES
from mpucal.errors import LateRead
from mpucal.sources.host_bus import TRIES, ReadTimer

USUAL_NS = 400_000


class Host:
    """Clock with transfers of given durations, and then of the usual one."""

    def __init__(self):
        self.now_ns, self.takes_ns, self.read = 0, [], count()

    def transfer(self):
        self.now_ns += self.takes_ns.pop(0) if self.takes_ns else USUAL_NS
        return bytes([next(self.read)])


@pytest.fixture
def host():
    return Host()


@pytest.fixture
def read(host):
    stamp = ReadTimer(lambda: host.now_ns)
    read = lambda register=reg.FIFO_COUNT_H, count=2: stamp.read(register, count, host.transfer)  # noqa: E731
    read()
    return read


def test_of_nothing_but_pauses_no_time_is_known(host, read):
    host.takes_ns = [14_000_000, 5_000_000, 9_000_000]
    with pytest.raises(LateRead, match="took 9 ms longer than usual"):
        read()
    assert next(host.read) == 1 + TRIES


@pytest.mark.parametrize(
    ("register", "count", "tries"),
    [
        (reg.FIFO_COUNT_H, 2, 2),
        (reg.ACCEL_XOUT_H, 14, 2),
        (reg.INT_ENABLE, SAMPLE_BYTES, 2),
        ("iio:device0/in_accel_x_raw", 4096, 2),
        (reg.INT_ENABLE, STATUS_BYTES, 1),
        (reg.FIFO_R_W, 512, 1),
        ("iio:device0/in_accel_scale", 4096, 1),
    ],
)
def test_only_what_is_a_time_of_samples_is_read_again(host, read, register, count, tries):
    read(register, count)
    host.takes_ns = [14_000_000]
    before = next(host.read)
    read(register, count)
    assert next(host.read) - before - 1 == tries
