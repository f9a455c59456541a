"""Kill sessions at random points, resume them, and compare with the same bytes unbroken.

python -m tools.lab kill_trials --seeds 10

Each session runs in a process of its own on the simulated chip, is killed (SIGKILL) as soon as it says that a random
time has come, and is resumed into a second capture file. Then `mpucal calibrate` of its folder must give the D and b_a
of the session, and those of one capture that holds the records of both; and no more than a second may be lost.
"""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

import numpy as np

from mpucal.calibration import calibrate
from mpucal.chip.records import SessionEvent
from mpucal.files import load
from mpucal.files.folder import captures_in
from mpucal.files.mcap import CaptureWriter, read_capture
from mpucal.result.calibration import Calibration

from .trials import command_line, in_parallel

KILLED_S, LONGEST_LOST_S = (0.5, 60.0), 1.0


def session(*words: object) -> list[str]:
    """The command's words."""
    return [sys.executable, "-m", "mpucal", "session", *map(str, words), "--json-events", "--yes"]


def killed_at(t_s: float, folder: Path, seed: int, rate_hz: float) -> float:
    """Run a session and kill it as soon as it says `t_s` or more; the time it came to."""
    words = session("--bus", "sim", "--seed", seed, "--rate", rate_hz, "-o", folder)
    come_to_s = 0.0
    with subprocess.Popen(words, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as program:
        for line in program.stderr or ():
            come_to_s = max(come_to_s, json.loads(line).get("t_s", 0.0))
            if come_to_s >= t_s:
                program.send_signal(signal.SIGKILL)
                break
    return come_to_s


def joined(folder: Path) -> Path:
    """One capture with the records of all in `folder`."""
    captures = [read_capture(path) for path in captures_in(folder)]
    path = folder / "joined.mcap"
    with CaptureWriter(path) as writer:
        writer.start(captures[0].meta)
        for record in (record for capture in captures for record in capture.records):
            if isinstance(record, SessionEvent):
                writer.event(record.name, record.t_ns, record.data)
            else:
                writer.transaction(record)
    return path


def trial(seed: int, rate_hz: float) -> tuple[str, bool]:
    """How one went, and whether it may go so: as much is kept as may be, and all three ways give the same numbers."""
    t_s = random.Random(seed).uniform(*KILLED_S)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "board"
        come_to_s = killed_at(t_s, folder, seed, rate_hz)
        records = read_capture(folder / "capture.mcap").records
        lost_s = max(come_to_s - (records[-1].t_ns * 1e-9 if records else 0.0), 0.0)
        killed = f"killed at {t_s:5.1f} s: lost {lost_s:.2f} s"
        resumed = subprocess.run(session("--resume", folder), capture_output=True, text=True, check=False)
        if resumed.returncode not in (0, 5):
            return f"{killed}, exit {resumed.returncode}: {resumed.stderr.splitlines()[-1]}", False
        found = Calibration.load(folder / "calibration.json")
        others = [calibrate(load(folder)), calibrate(load(joined(folder)))]
    same = all(np.array_equal(found.D, other.D) and np.array_equal(found.b_a, other.b_a) for other in others)
    return f"{killed}, resumed to {found.verdict}, same bits: {same}", same and lost_s <= LONGEST_LOST_S


def main() -> int:
    """Run them; 1 where one lost more than it may, or differs."""
    parser = command_line(__doc__, "1:11")
    parser.add_argument("--rate", type=float, default=100.0)
    asked = parser.parse_args()
    right = True
    for text, good in in_parallel(partial(trial, rate_hz=asked.rate), asked.seeds, asked.jobs):
        print(text, flush=True)
        right &= good
    return int(not right)
