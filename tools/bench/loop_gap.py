"""Longest gap of the reading loop while fits run, and the share of a core that a live session takes.

python -m tools.bench loop_gap --rate 1000 --seconds 70
python -m tools.bench loop_gap --rate 200 --seconds 70

A session on the simulated chip at a person's pace, recorded into a capture: the gap is the time between reads of
FIFO_COUNT; at 1 kHz the FIFO overflows 36 ms after it was emptied. The program compares sessions without fits, with
fits in the loop, with fits in a process of their own (as in a real session), and this with a page that one client reads
and another one has stopped reading. The simulation takes part of the time.
"""

from __future__ import annotations

import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np

from mpucal.chip import registers as reg
from mpucal.chip.access import Bus, Reply
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.data import Sensor, Vector
from mpucal.errors import EndOfCapture
from mpucal.files.mcap import CaptureWriter
from mpucal.page.address import Address
from mpucal.page.feed import Feed
from mpucal.session.events import Event, Output
from mpucal.session.live.fits import Task
from mpucal.session.live.scheduler import InlineWorker, Worker
from mpucal.session.live.worker_process import ProcessWorker
from mpucal.session.plan import Plan
from mpucal.session.runner import Runner
from mpucal.simulated.chip import open_simulated
from mpucal.sources.tap import Tap
from tools.lab.sessions import SilentOperator

from .timing import ended_children_s, used

FIFO_FRAMES = 512 // reg.FRAME_BYTES


Hire = Callable[[Plan, Sensor], Worker]


class IdleWorker:
    """Worker that does not compute: each answer is empty, at once."""

    def __init__(self, _plan: Plan, _sensor: Sensor) -> None: ...

    def submit(self, _task: Task) -> Future[Event | None]:
        """See Worker."""
        answer: Future[Event | None] = Future()
        answer.set_result(None)
        return answer

    def close(self) -> None:
        """See Worker."""


HIRED: dict[str, tuple[Hire, bool]] = {
    "without fits": (IdleWorker, False),
    "with fits in the loop": (InlineWorker, False),
    "with fits apart": (ProcessWorker, False),
    "with fits apart, and a page": (ProcessWorker, True),
}
READS = "import sys, urllib.request; urllib.request.urlopen(sys.argv[1] + 'events').read()"


class TimedBus:
    """Bus that notes the times of reads of FIFO_COUNT, and ends after some seconds."""

    def __init__(self, bus: Bus, seconds: float) -> None:
        self._bus, self._end_ns = bus, time.monotonic_ns() + round(seconds * 1e9)
        self.write, self.sleep_until, self.close = bus.write, bus.sleep_until, bus.close
        self.looks_ns: list[int] = []

    def read(self, register: int, count: int) -> Reply:
        """See Bus."""
        if register == reg.FIFO_COUNT_H:
            self.looks_ns.append(time.monotonic_ns())
        if time.monotonic_ns() > self._end_ns:
            raise EndOfCapture
        return self._bus.read(register, count)


class Listener(SilentOperator):
    """Operator who presses nothing; the count of reads begins at the first prompt, when the chip is configured."""

    def __init__(self, bus: TimedBus, feed: Feed | None) -> None:
        super().__init__()
        self._bus, self._feed = bus, feed

    def hear(self, output: Output) -> None:
        """Begin to count at the first output; pass all outputs to the page."""
        if self._feed is not None:
            self._feed.hear(output)
        if not self.heard:
            self._bus.looks_ns.clear()
        super().hear(output)


@contextmanager
def followed(page: bool) -> Iterator[Feed | None]:
    """Yield a page with two clients if `page` is given, else None."""
    if not page:
        yield None
        return
    feed = Feed(Address(), {"title": "trial", "board": "gy-521"})
    where = urlsplit(feed.url)
    with (
        socket.create_connection((where.hostname, where.port)) as stalled,
        subprocess.Popen([sys.executable, "-c", READS, feed.url]) as reading,
    ):
        stalled.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1024)
        stalled.sendall(f"GET {where.path}events HTTP/1.1\r\nHost: {where.netloc}\r\n\r\n".encode())
        yield feed
        reading.kill()
        feed.close()


def measure(rate_hz: float, seconds: float, start_worker: Hire, page: bool) -> tuple[Vector, float]:
    """Run a session; return the gaps (n,) between reads [ms], and the share of a core that was used."""
    chip = open_simulated("sim:pace=real", seed=1)
    bus = TimedBus(chip, seconds)
    plan = Plan(Config(rate_hz=rate_hz), target="best")
    with (
        followed(page) as feed,
        tempfile.TemporaryDirectory() as folder,
        CaptureWriter(Path(folder) / "capture.mcap") as writer,
    ):
        writer.start({})
        driver = Driver(Tap(bus, writer), plan.config)
        runner = Runner(driver, Listener(bus, feed), writer.event, plan, (chip.hear,), start_worker=start_worker)
        with used(ended_children_s) as found:
            runner.measure()
    return np.diff(bus.looks_ns) * 1e-6, (found.cpu_s + found.children_s) / found.wall_s


def main(*, rate: float = 1000.0, seconds: float = 70.0) -> None:
    """Measure each arrangement."""
    print(f"{rate:g} Hz, {seconds:g} s; a 512-byte FIFO holds {1000.0 * FIFO_FRAMES / rate:.0f} ms")
    for name, (start_worker, page) in HIRED.items():
        gaps, share = measure(rate, seconds, start_worker, page)
        print(
            f"{name}: gaps {np.median(gaps):.1f} ms in the median, "
            f"{np.quantile(gaps, 0.99):.1f} at 99 %, {gaps.max():.1f} at worst; {share:.0%} of a core",
            flush=True,
        )
