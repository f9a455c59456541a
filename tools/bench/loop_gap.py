"""Samples that a session loses, and the longest gap between two of its reads, on a computer that is busy.

python -m tools.bench loop_gap --seconds 60
python -m tools.bench loop_gap --seconds 60 --load 20 --rate 1000 --chip mpu6500

`mpucal session` on the simulated chip at a person's pace, on a terminal of its own and with a page that one client
reads and another one has stopped reading, beside `load` endless loops of the same priority. The capture shows the times
of the reads of FIFO_COUNT, and the samples that are missing. An MPU-6050's FIFO holds 0.36 s at 200 Hz and 73 ms at
1 kHz, an MPU-6500's half of it.
"""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated
from urllib.parse import urlsplit

import numpy as np
import pexpect
import psutil

import mpucal
from mpucal.chip import registers as reg
from mpucal.chip.access import Transaction
from mpucal.files.mcap import read_capture

ENDLESS = "while True: pass"
READS = "import sys, urllib.request; urllib.request.urlopen(sys.argv[1] + 'events').read()"


def measure(words: list[str], seconds: float, load: int, folder: Path) -> tuple[Path, float]:
    """Run a session for some seconds; return its capture, and the share of a core that it used."""
    command = ["-m", "mpucal", "session", *words, "-o", str(folder), "--page", "--target", "best"]
    begun = time.monotonic()
    with ExitStack() as stack:
        session = pexpect.spawn(sys.executable, command)
        stack.callback(session.close, force=True)
        session.expect(rb"http://\S+/")
        where = urlsplit(url := session.after.decode())
        stalled = stack.enter_context(socket.create_connection((where.hostname, where.port)))
        stalled.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1024)
        stalled.sendall(f"GET {where.path}events HTTP/1.1\r\nHost: {where.netloc}\r\n\r\n".encode())
        for code in ([READS, url], *([ENDLESS],) * load):
            stack.callback(subprocess.Popen([sys.executable, "-c", *code], stderr=subprocess.DEVNULL).kill)
        session.send(b"\n")
        # which reads its terminal meanwhile
        session.expect([pexpect.EOF, pexpect.TIMEOUT], timeout=seconds)
        family = [of := psutil.Process(session.pid), *of.children(recursive=True)]
        share = sum(sum(each.cpu_times()[:2]) for each in family) / (time.monotonic() - begun)
        session.kill(signal.SIGINT)
        session.expect(pexpect.EOF)
    return next(folder.parent.rglob("*.mcap")), share


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
        recording, records = mpucal.load(capture), read_capture(capture).records
    accesses = [each for each in records if isinstance(each, Transaction) and each.register == reg.FIFO_COUNT_H]
    looks_s = np.array([access.t_ns for access in accesses]) * 1e-9
    gaps_ms = np.diff(looks_s[looks_s >= recording.t[0]]) * 1e3
    lost_s = np.diff(recording.t)[recording.gap[1:]] - 1.0 / recording.rate_hz
    print(
        f"{chip} at {rate:g} Hz, {load} loops beside it: reads {np.median(gaps_ms):.1f} ms apart in the"
        f" median, {np.quantile(gaps_ms, 0.99):.1f} at 99 %, {gaps_ms.max():.1f} at worst; {len(recording)} samples,"
        f" {lost_s.sum():.2f} s lost in {len(lost_s)} places; {share:.0%} of a core"
    )
