"""Samples that a session loses, and the longest gap between two of its reads, on a computer that is busy.

python -m tools.bench loop_gap --seconds 60
python -m tools.bench loop_gap --seconds 60 --load 20 --rate 1000 --chip mpu6500
python -m tools.bench loop_gap --seconds 60 --load 20 --source serial --ordinary

`mpucal session` on a simulated sensor at a person's pace, on a terminal of its own and with a page that one client
reads and another one has stopped reading, beside `load` endless loops of the same priority. Each loop is a kernel
session of its own, as the programs of different services are: a kernel that schedules by sessions would count loops of
one session as one program. The capture shows the times of the reads, and the samples that are missing. An MPU-6050's
FIFO holds 0.36 s at 200 Hz and 73 ms at 1 kHz. Behind a serial bridge, a read's time is that of its bytes' arrival.
"""

import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
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
# Takes the right to real-time priorities from root.
ORDINARY = ("setpriv", "--bounding-set=-sys_nice")
# The option of a source and its simulation; a bridge is on a terminal of its own.
SOURCES = {"chip": "bus", "iio": "iio", "serial": "serial"}
# Registers and files of which each read takes samples.
READ_PLACES = (reg.FIFO_COUNT_H, "iio:device0")


def measure(
    words: Sequence[str], seconds: float, load: int, folder: Path, before: Sequence[str] = ()
) -> tuple[Path, float]:
    """Run a session for some seconds, by a command with words `before`; return its capture, and its share of a core."""
    command = [*before, sys.executable, "-m", "mpucal", "session", *words, "-o", str(folder), "--page"]
    begun = time.monotonic()
    with ExitStack() as stack:
        session = pexpect.spawn(command[0], [*command[1:], "--target", "best"])
        stack.callback(session.close, force=True)
        session.expect(rb"http://\S+/")
        where = urlsplit(url := session.after.decode())
        stalled = stack.enter_context(socket.create_connection((where.hostname, where.port)))
        stalled.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1024)
        stalled.sendall(f"GET {where.path}events HTTP/1.1\r\nHost: {where.netloc}\r\n\r\n".encode())
        for code in ([READS, url], *([ENDLESS],) * load):
            started = [sys.executable, "-c", *code]
            beside = subprocess.Popen(started, stderr=subprocess.DEVNULL, start_new_session=True)
            stack.callback(beside.wait)
            stack.callback(beside.kill)
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
    source: Annotated[str, SOURCES, "chip, iio or serial"] = "chip",
    rate: Annotated[float, "Hz"] = 200.0,
    seconds: float = 60.0,
    load: Annotated[int, "endless loops beside the session"] = 0,
    chip: str = "mpu6050",
    ordinary: Annotated[bool, "take the right to real-time priorities from the session, if root runs this"] = False,
) -> None:
    """Measure and print."""
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        text = f"chip={chip}"
        if source == "serial":
            emulator = [sys.executable, "-m", "tools.lab", "sim_bridge", f"{text},hand=random,seed=1"]
            bridge = stack.enter_context(subprocess.Popen(emulator, stdout=subprocess.PIPE, text=True))
            stack.callback(bridge.kill)
            words = ["--serial", next(iter(bridge.stdout or ())).strip()]
        else:
            words = [f"--{SOURCES[source]}", f"sim:pace=real,{text}", "--seed", "1"]
        words += ["--rate", f"{rate:g}"]
        capture, share = measure(words, seconds, load, Path(folder) / "board", ORDINARY if ordinary else ())
        recording, records = mpucal.load(capture), read_capture(capture).records
    reads = [each for each in records if isinstance(each, Transaction) and each.register in READ_PLACES]
    reads_s = np.array([each.t_ns if each.host_ns is None else each.host_ns for each in reads]) * 1e-9
    gaps_ms = np.diff(reads_s[[each.t_ns * 1e-9 >= recording.t[0] for each in reads]]) * 1e3
    lost_s = np.diff(recording.t)[recording.gap[1:]] - 1.0 / recording.rate_hz
    print(
        f"{source} ({chip}) at {rate:g} Hz, {load} loops beside it: reads {np.median(gaps_ms):.1f} ms apart in the"
        f" median, {np.quantile(gaps_ms, 0.99):.1f} at 99 %, {gaps_ms.max():.1f} at worst; {len(recording)} samples,"
        f" {lost_s.sum():.2f} s lost in {len(lost_s)} places; {share:.0%} of a core"
    )
