"""Samples that a session loses, and the longest gap between two of its reads, on a computer that is busy.

python -m tools.bench loop_gap --seconds 60
python -m tools.bench loop_gap --seconds 60 --load 20 --rate 1000 --chip mpu6500

`mpucal session` on the simulated chip at a person's pace, on a terminal of its own and with a page that one client
reads and another one has stopped reading, beside `load` endless loops of the same priority. The capture shows the times
of the reads of FIFO_COUNT, and the samples that are missing. An MPU-6050's FIFO holds 0.36 s at 200 Hz and 73 ms at
1 kHz, an MPU-6500's half of it.
"""

from __future__ import annotations

import os
import pty
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Annotated
from urllib.parse import urlsplit

import numpy as np

import mpucal
from mpucal.chip import registers as reg
from mpucal.chip.access import Transaction
from mpucal.data import Recording, Vector
from mpucal.files.mcap import read_capture

ENDLESS = "while True: pass"
READS = "import sys, urllib.request; urllib.request.urlopen(sys.argv[1] + 'events').read()"


@contextmanager
def running(*code: str) -> Iterator[None]:
    """Run code of Python in a process of its own for the duration of a `with` block."""
    with subprocess.Popen([sys.executable, "-c", *code], stderr=subprocess.DEVNULL) as process:
        try:
            yield
        finally:
            process.kill()


class Terminal:
    """Terminal of a session: its output is read, and searched for the address of the page."""

    def __init__(self) -> None:
        self._ours, self.theirs = pty.openpty()
        self._said = b""
        threading.Thread(target=self._read, daemon=True).start()

    def url(self) -> str:
        """Wait for the address of the page."""
        while not (found := re.search(rb"http://\S+/", self._said)):
            time.sleep(0.1)
        return found[0].decode()

    def press(self, keys: bytes) -> None:
        """Press keys."""
        os.write(self._ours, keys)

    def _read(self) -> None:
        with suppress(OSError):
            while data := os.read(self._ours, 1 << 16):
                self._said = (self._said + data)[-(1 << 16) :]


def measure(words: list[str], seconds: float, load: int, folder: Path) -> tuple[Path, float]:
    """Run a session for some seconds; return its capture, and the share of a core that it used."""
    terminal, stack = Terminal(), ExitStack()
    command = [sys.executable, "-m", "mpucal", "session", *words, "-o", str(folder), "--page", "--target", "best"]
    begun = time.monotonic()
    session = subprocess.Popen(command, stdin=terminal.theirs, stdout=terminal.theirs, stderr=terminal.theirs)
    url = terminal.url()
    where = urlsplit(url)
    with stack:
        stalled = stack.enter_context(socket.create_connection((where.hostname, where.port)))
        stalled.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1024)
        stalled.sendall(f"GET {where.path}events HTTP/1.1\r\nHost: {where.netloc}\r\n\r\n".encode())
        stack.enter_context(running(READS, url))
        terminal.press(b"\n")
        for _ in range(load):
            stack.enter_context(running(ENDLESS))
        time.sleep(seconds)
    session.send_signal(signal.SIGINT)
    _, _, spent = os.wait4(session.pid, 0)
    return next(folder.parent.rglob("*.mcap")), (spent.ru_utime + spent.ru_stime) / (time.monotonic() - begun)


def gaps_ms(capture: Path, recording: Recording) -> Vector:
    """Return the times (n,) between two reads of FIFO_COUNT [ms], from the first sample on."""
    accesses = [record for record in read_capture(capture).records if isinstance(record, Transaction)]
    looks_s = np.array([access.t_ns for access in accesses if access.register == reg.FIFO_COUNT_H]) * 1e-9
    return np.asarray(np.diff(looks_s[looks_s >= recording.t[0]]) * 1e3)


def lost_s(recording: Recording) -> Vector:
    """Return the duration of each place (k,) where samples are missing [s]."""
    steps = np.diff(recording.t)
    return np.asarray(steps[recording.gap[1:]] - 1.0 / recording.rate_hz)


def main(
    *,
    rate: Annotated[float, "Hz"] = 200.0,
    seconds: float = 60.0,
    load: Annotated[int, "endless loops beside the session"] = 0,
    chip: str = "mpu6050",
) -> None:
    """Measure and print."""
    words = ["--bus", f"sim:pace=real,chip={chip}", "--seed", "1", "--rate", f"{rate:g}"]
    with tempfile.TemporaryDirectory() as folder:
        capture, share = measure(words, seconds, load, Path(folder) / "board")
        recording = mpucal.load(capture)
        gaps = gaps_ms(capture, recording)
    lost = lost_s(recording)
    print(
        f"{chip} at {rate:g} Hz, {load} loops beside it: reads {np.median(gaps):.1f} ms apart in the"
        f" median, {np.quantile(gaps, 0.99):.1f} at 99 %, {gaps.max():.1f} at worst; {len(recording)} samples,"
        f" {lost.sum():.2f} s lost in {len(lost)} places; {share:.0%} of a core"
    )
