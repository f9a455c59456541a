"""Fixtures: a simulated chip behind an emulated bridge, on a line whose time runs only while the host waits."""

import contextlib
import os
import select
import threading
import tty
from types import SimpleNamespace

import pytest

from mpucal.bridge import bus, link
from mpucal.bridge.bus import BridgeBus
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.simulated.chip import SimulatedBus
from mpucal.simulated.chip.bus import FastClock
from mpucal.simulated.chip.chip import Chip
from mpucal.simulated.chip.models import MODELS, FactoryTrim
from tools.lab import feeds
from tools.lab.bridge import EmulatedBridge, EmulatedLine

MS = 1_000_000


class Rig(SimpleNamespace):
    """Parts by name: clock, chip, line, and `bus` on demand."""

    def new_chip(self):
        """Replace the chip by one that was just switched on."""
        self.chip = SimulatedBus(Chip(MODELS[self.model], feeds.NumberedFeed(), 2500.0, FactoryTrim()), self.clock)

    def new_bridge(self, boot_ns=0, **how):
        """Make a bridge that was just switched on, with the present chip."""
        started_ns = self.clock.now()
        bridge = EmulatedBridge(self.chip, lambda: self.clock.now() - started_ns, **{**self.how, **how})
        return Booting(bridge, self.clock, started_ns + boot_ns)

    def bus(self, address=None):
        self.opened = BridgeBus(self.line, address)
        return self.opened


class Booting:
    """Bridge whose boot loader takes all bytes until `ready_ns`."""

    def __init__(self, bridge, clock, ready_ns):
        self.bridge, self.clock, self.ready_ns = bridge, clock, ready_ns

    def receive(self, data):
        if self.clock.now() >= self.ready_ns:
            self.bridge.receive(data)

    def work(self):
        return self.bridge.work()


@pytest.fixture(scope="session")
def rig():
    def make(model="mpu6050", latency_ns=MS, boot_ns=0, line=None, **how):
        made = Rig(model=model, clock=FastClock(), how=how)
        made.new_chip()
        made.line = EmulatedLine(
            made.new_bridge(boot_ns), made.clock, **{"latency_ns": latency_ns, "step_ns": MS, **(line or {})}
        )
        return made

    return make


@pytest.fixture(scope="session")
def started(rig):
    """Makes a rig and starts a driver on its bus: (rig, driver)."""

    def start(model="mpu6050", latency_ns=MS, rate_hz=200, say=lambda _sentence: None, **how):
        made = rig(model, latency_ns, **how)
        driver = Driver(made.bus(), Config(rate_hz=rate_hz), say=say)
        driver.start()
        return made, driver

    return start


@pytest.fixture(scope="session")
def stream():
    """Polls a started driver for some seconds."""

    def run(driver, seconds):
        end_ns = driver.now_ns() + round(seconds * 1e9)
        while driver.now_ns() < end_ns:
            driver.poll()

    return run


class Server:
    """Thread that serves an emulated bridge on a pseudo terminal, in a time that runs as fast as possible.

    Attributes
    ----------
    name : port for the host. device : the bridge; replacing it is a reset. clock : of the bridge.
    """

    def __init__(self, device, clock, handle):
        self.device, self.clock, self.name, self._handle = device, clock, handle.name, handle
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def stop(self):
        if not self._stop.is_set():
            self._stop.set()
            self._thread.join()
            self._handle.close()

    def _serve(self):
        with contextlib.suppress(OSError):
            while not self._stop.is_set():
                if select.select([self._handle], [], [], 0.0005)[0]:
                    self.device.receive(self._handle.read())
                self.clock.sleep_until(self.clock.now() + MS)
                self._handle.write(self.device.work())


class Pty:
    """Board's end of a pseudo terminal."""

    def __init__(self):
        self._host, there = os.openpty()
        tty.setraw(there)
        self.name, self._there = os.ttyname(there), there

    def fileno(self):
        return self._host

    def read(self):
        return os.read(self._host, 4096)

    def write(self, data):
        while data:
            if select.select([], [self._host], [], 0.1)[1]:
                data = data[os.write(self._host, data) :]

    def close(self):
        os.close(self._host)
        os.close(self._there)


@pytest.fixture
def serve(monkeypatch):
    """Serves a device on a pseudo terminal, with time-outs that a busy machine does not reach."""
    monkeypatch.setattr(link, "REPLY_NS", 20_000 * MS)
    monkeypatch.setattr(bus, "GONE_NS", 20_000 * MS)
    servers = []

    def begin(device, clock):
        servers.append(Server(device, clock, Pty()))
        return servers[-1]

    yield begin
    for server in servers:
        server.stop()
