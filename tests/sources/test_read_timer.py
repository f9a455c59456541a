"""A read that was delayed by a pause of the process is repeated, or fails: its time would be early by the pause."""

from itertools import count

import pytest

from mpucal.errors import LateRead
from mpucal.sources.host_bus import TRIES, HostBus

USUAL_NS = 400_000


class Host(HostBus):
    """Bus with a clock of its own and transfers of given durations, and then of the usual one."""

    def __init__(self):
        super().__init__()
        self.t_ns, self.takes_ns, self.read = 0, [], count()

    def now_ns(self):
        return self.t_ns

    def transfer(self):
        self.t_ns += self.takes_ns.pop(0) if self.takes_ns else USUAL_NS
        return bytes([next(self.read)])


@pytest.fixture
def host():
    return Host()


@pytest.fixture
def read(host):
    read = lambda matters=True: host.timed_read(0x72, 2, matters, host.transfer)  # noqa: E731
    read()
    return read


def test_reads_that_are_all_paused_give_no_time(host, read):
    host.takes_ns = [14_000_000, 5_000_000, 9_000_000]
    with pytest.raises(LateRead, match="took 9 ms longer than usual"):
        read()
    assert next(host.read) == 1 + TRIES


@pytest.mark.parametrize(("matters", "tries"), [(True, 2), (False, 1)])
def test_only_a_read_whose_time_matters_is_repeated(host, read, matters, tries):
    host.takes_ns = [14_000_000]
    before = next(host.read)
    read(matters)
    assert next(host.read) - before - 1 == tries
