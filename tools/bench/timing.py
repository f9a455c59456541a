"""Time and memory: of a part of a program, of a call, and of a command in a process of its own."""

import statistics
import subprocess
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tools.processes import Ended, ended


@dataclass
class Used:
    """Time that a block used [s]: wall time, processor time of this process, and of its children."""

    wall_s: float = 0.0
    cpu_s: float = 0.0
    children_s: float = 0.0


@contextmanager
def used(children_s: Callable[[], float] = lambda: 0.0) -> Iterator[Used]:
    """Yield the time that the block uses, set at its end; `children_s` returns the time of the children so far [s]."""
    found, begun, cpu_s, of_children_s = Used(), time.perf_counter(), time.process_time(), children_s()
    try:
        yield found
    finally:
        found.wall_s, found.cpu_s = time.perf_counter() - begun, time.process_time() - cpu_s
        found.children_s = children_s() - of_children_s


def median_s(call: Callable[[], Any], runs: int) -> float:
    """Return the median processor time of `runs` calls [s], after one that warms up."""
    call()
    times = []
    for _ in range(runs):
        began = time.process_time()
        call()
        times.append(time.process_time() - began)
    return statistics.median(times)


def peak_bytes(call: Callable[[], Any]) -> int:
    """Return the most memory that the call's arrays took beyond what was there; the kernel itself keeps none."""
    tracemalloc.start()
    call()
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return peak


def command(words: Sequence[str], folder: Path) -> tuple[float, Ended]:
    """Run `mpucal words` in a process of its own; return s by the clock, and how it ended.

    Raises
    ------
    RuntimeError : it ended with another exit code than 0.
    """
    begun = time.perf_counter()
    with tempfile.NamedTemporaryFile() as said:
        process = subprocess.Popen(
            [sys.executable, "-m", "mpucal", *words], cwd=folder, stdout=subprocess.DEVNULL, stderr=said
        )
        done = ended(process.pid, Path(said.name), float("inf"))
    if done.code != 0:
        raise RuntimeError(done.last)
    return time.perf_counter() - begun, done
