"""Fixtures: a simulated chip whose samples are numbered, on a bus that can be made to fail."""

from collections.abc import Callable

import numpy as np
import pytest

from mpucal.chip import registers as reg
from mpucal.chip.access import Reply
from mpucal.chip.driver import Driver
from mpucal.data import Samples
from mpucal.errors import BusError
from mpucal.simulated.chip import open_simulated
from mpucal.simulated.chip.bus import FastClock, SimulatedBus
from mpucal.simulated.chip.chip import Chip
from mpucal.simulated.chip.models import MODELS, FactoryTrim
from mpucal.sources.replay import Tap
from tools.lab import feeds


class Rig:
    """Chip, bus with faults, and a list of all transactions.

    `before` holds, by (op, register), a function to call before an access, or at ("answer", register) one that
    changes the bytes read.
    """

    def __init__(self, model="mpu6050", rate_error_ppm=3000.0):
        self.clock, self.transactions = FastClock(), []
        self.chip = Chip(MODELS[model], feeds.NumberedFeed(), rate_error_ppm, FactoryTrim((-1500, 2001, 700)))
        self.inner = SimulatedBus(self.chip, self.clock)
        self.before: dict[tuple[str, int], Callable] = {}
        self.bus = Tap(self, self.transactions.append)
        self.sleep_until, self.close = self.inner.sleep_until, self.inner.close

    def read(self, register, count):
        self.before.get(("read", register), _nothing)()
        reply = self.inner.read(register, count)
        answer = self.before.get(("answer", register))
        return reply if answer is None else Reply(answer(reply.data), reply.t_ns)

    def write(self, register, data):
        self.before.get(("write", register), _nothing)()
        return self.inner.write(register, data)

    def driver(self, config=None):
        return Driver(self.bus, config)

    def fail(self, op, register, times):
        """Make the next `times` accesses to `register` fail."""
        left = iter(range(times))

        def broken():
            if next(left, None) is not None:
                raise BusError("a transfer broke off", "check the wires")

        self.before[op, register] = broken

    def stall(self, seconds):
        """Hold the host up for a while."""
        self.clock.spend(round(seconds * 1e9))

    def slip(self, count):
        """Take `count` bytes out of the FIFO, so that its frames are misaligned."""
        self.stall(0.01)
        self.inner.read(reg.FIFO_R_W, count)

    def writes(self):
        return [(t.register, t.data) for t in self.transactions if t.op == "write"]


def _nothing():
    pass


@pytest.fixture(scope="session")
def rig():
    """Makes a rig with a chip of the given model."""
    return Rig


@pytest.fixture(scope="session")
def started():
    """Makes a rig and starts its driver: (rig, driver)."""

    def start(model="mpu6050", config=None, **options):
        made = Rig(model, **options)
        driver = made.driver(config)
        driver.start()
        return made, driver

    return start


@pytest.fixture(scope="session")
def tapped():
    """Opens a simulated chip and records its transactions: (bus, transactions)."""

    def tap(words):
        transactions = []
        return Tap(open_simulated(words), transactions.append), transactions

    return tap


@pytest.fixture(scope="session")
def stream():
    """Polls a started driver for some seconds after the first poll, and returns its samples, joined."""

    def run(driver, seconds):
        parts = [driver.poll()]
        end_ns = driver.now_ns() + seconds * 1e9
        while driver.now_ns() < end_ns:
            parts.append(driver.poll())
        return Samples.joined(parts)

    return run


@pytest.fixture(scope="session")
def same():
    """Compares two recordings bit by bit."""
    names = ("t", "acc", "gyr", "temperature_c", "gap", "acc_clipped", "gyr_clipped")
    return lambda a, b: (
        a.sensor == b.sensor
        and all(np.array_equal(getattr(a, n), getattr(b, n), equal_nan=n in ("gyr", "temperature_c")) for n in names)
    )
