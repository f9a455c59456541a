"""How `mpucal batch` scales: rows a second by workers, what the engine costs a row, and what kills do to it.

python -m tools.bench batch_scale --captures 200 --workers 1 2
python -m tools.bench batch_scale --captures 10000 --workers 2 --kill --of sessions/*/capture.mcap
python -m tools.bench batch_scale --captures 2000 --engine-only

Synthetic captures: stored sessions' accesses with every board's own bias, that is with other counts in their FIFO
frames; of each hundred one is cut, and one is junk. With --engine-only there are none to read: what is left is the
engine and the journal. With --kill a worker is killed after a third of the rows, and the whole cluster after two.
"""

from __future__ import annotations

import argparse
import csv
import io
import resource
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import numpy as np
import psutil

from mpucal.batch.journal import Journal
from mpucal.batch.many import JOURNAL, local_client, run
from mpucal.batch.row import Settings, row_of
from mpucal.batch.table import write
from mpucal.chip import registers as reg
from mpucal.chip.access import Transaction
from mpucal.files.mcap import CaptureWriter, read_capture

SESSIONS = Path(__file__).parents[2] / "fixtures" / "sessions"


def write_captures(folder: Path, count: int, stored: Sequence[Path]) -> list[str]:
    """That many captures, of which each hundred has one that is cut and one that is junk."""
    captures, rng = [read_capture(path) for path in stored], np.random.default_rng(1)
    paths = []
    for i in range(count):
        path, capture = folder / f"{i:06d}.mcap", captures[i % len(captures)]
        bias = np.concatenate((rng.normal(0, 100, 3), [0], rng.normal(0, 20, 3))).round().astype(np.int32)
        with CaptureWriter(path) as writer:
            writer.start(capture.meta)
            for each in capture.records:
                if not isinstance(each, Transaction):
                    writer.event(each.name, each.t_ns, each.data)
                elif each.register == reg.FIFO_R_W:
                    frames = np.frombuffer(each.data, ">i2").reshape(-1, reg.FRAME_WORDS) + bias
                    writer.transaction(replace(each, data=np.clip(frames, -32768, 32767).astype(">i2").tobytes()))
                else:
                    writer.transaction(each)
        if i % 100 == 50:
            path.write_bytes(path.read_bytes()[:3000])
        elif i % 100 == 51:
            path.write_bytes(b"junk")
        paths.append(str(path))
    return paths


@dataclass
class Cost:
    """Of a batch: s by the clock, s of processors in this program and in the workers that lived on."""

    seconds: float = 0.0
    program_s: float = 0.0
    workers_s: float = 0.0

    @contextmanager
    def counted(self) -> Iterator[None]:
        """What happens meanwhile."""
        children = psutil.Process().children(recursive=True)
        begun, program_s, workers_s = time.perf_counter(), time.process_time(), _processor_s(children)
        try:
            yield
        finally:
            self.seconds += time.perf_counter() - begun
            self.program_s += time.process_time() - program_s
            self.workers_s += _processor_s(children) - workers_s

    def said(self, rows: int) -> str:
        """A row."""
        each = (1e3 * x / rows for x in (self.program_s, self.workers_s))
        return "{:.2f} rows/s; of a processor a row: program and scheduler {:.2f} ms, workers {:.2f} ms".format(
            rows / self.seconds, *each
        )


def _processor_s(children: list[psutil.Process]) -> float:
    return float(sum(sum(child.cpu_times()[:2]) for child in children if child.is_running()))


def timed(paths: list[str], workers: int, journal: Journal, settings: Settings, until: int | None = None) -> Cost:
    """A batch on workers of its own; `until` : a worker is killed after half of so many rows, and all after them."""
    cost = Cost()
    with local_client(workers) as client:
        client.wait_for_workers(workers)
        # what a worker imports with its first row
        client.run(row_of, str(SESSIONS / "mpu6050.mcap"), settings)
        processes = list(client.run(_process).values())
        with cost.counted():
            for progress in islice(run(paths, client, journal, settings), until):
                if until is not None and progress.done == until // 2:
                    psutil.Process(processes[0]).kill()
    return cost


def _process() -> int:
    return psutil.Process().pid


def measured(folder: Path, paths: list[str], workers: int, settings: Settings, kill: bool) -> bytes:
    """What a batch costs; its results.csv."""
    folder.mkdir()
    journal = Journal(folder / JOURNAL, settings.key)
    try:
        if kill:
            timed(paths, workers, journal, settings, until=2 * len(paths) // 3)
            print(f"{workers} workers, one killed, and then all: {len(journal)} rows are there", flush=True)
        kept = len(journal)
        cost = timed(paths, workers, journal, settings)
        print(f"{workers} workers: {cost.said(len(paths) - kept)}", flush=True)
        cost = timed(paths, workers, journal, settings)
        print(f"  again, all there already: {cost.said(len(paths))}", flush=True)
        return write(folder, journal.rows(paths))[1].read_bytes()
    finally:
        journal.close()


def main() -> None:
    """Measure what the options name."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--captures", type=int, default=100)
    parser.add_argument("--of", type=Path, nargs="+", default=sorted(SESSIONS.glob("mpu6[05]*.mcap")), help="captures")
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--model", default="auto")
    parser.add_argument("--engine-only", action="store_true", help="captures that are not there")
    parser.add_argument("--kill", action="store_true", help="a worker, and then all of them, in the last batch")
    options = parser.parse_args()
    settings, tables = Settings(options.model, 9.80665), []
    with tempfile.TemporaryDirectory() as name:
        if options.engine_only:
            paths = [f"{name}/none/{i}.mcap" for i in range(options.captures)]
        else:
            begun = time.perf_counter()
            paths = write_captures(Path(name), options.captures, options.of)
            size = sum(Path(path).stat().st_size for path in paths) / 1e6
            print(f"{len(paths)} captures, {size:.1f} MB, written in {time.perf_counter() - begun:.0f} s", flush=True)
        for workers in options.workers:
            kill = options.kill and workers == options.workers[-1]
            tables.append(measured(Path(name) / f"out-{workers}", paths, workers, settings, kill))
    counts = Counter(row["verdict"] or "not read" for row in csv.DictReader(io.StringIO(tables[0].decode())))
    print(f"{dict(counts)}; results.csv the same by all workers: {all(each == tables[0] for each in tables)}")
    here, each = (resource.getrusage(who).ru_maxrss / 1024 for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    print(f"this program took {here:.0f} MB at most, a worker {each:.0f} MB")
