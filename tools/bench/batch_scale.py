"""The scaling of `mpucal batch`: rows a second by workers, the engine's cost of a row, and the effect of kills.

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
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import psutil

from mpucal.batch.journal import RowJournal
from mpucal.batch.many import JOURNAL, local_client, run_batch
from mpucal.batch.row import Settings, make_row
from mpucal.batch.table import write_tables
from mpucal.chip import registers as reg
from mpucal.chip.access import Transaction
from mpucal.files.mcap import CaptureWriter, read_capture

from .timing import Used, used

SESSIONS = Path(__file__).parents[2] / "fixtures" / "sessions"


def write_captures(folder: Path, count: int, stored: Sequence[Path]) -> list[str]:
    """Write `count` captures; in each hundred, one is cut and one is junk."""
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


def cost(time: Used, rows: int) -> str:
    """Return the cost of `rows` rows in words."""
    program_ms, workers_ms = (1e3 * x / rows for x in (time.cpu_s, time.children_s))
    of = f"of a processor a row: program and scheduler {program_ms:.2f} ms, workers {workers_ms:.2f} ms"
    return f"{rows / time.wall_s:.2f} rows/s; {of}"


def timed(paths: list[str], workers: int, journal: RowJournal, settings: Settings, until: int | None = None) -> Used:
    """Run a batch on workers of its own; `until` : kill a worker after half of this number of rows, and all at it."""
    with local_client(workers) as client:
        client.wait_for_workers(workers)
        # loads the imports of a first row
        client.run(make_row, str(SESSIONS / "mpu6050.mcap"), settings)
        processes = list(client.run(_process).values())
        children = psutil.Process().children(recursive=True)
        with used(lambda: sum(sum(one.cpu_times()[:2]) for one in children if one.is_running())) as time:
            for progress in islice(run_batch(paths, client, journal, settings), until):
                if until is not None and progress.done == until // 2:
                    psutil.Process(processes[0]).kill()
    return time


def _process() -> int:
    return psutil.Process().pid


def measured(folder: Path, paths: list[str], workers: int, settings: Settings, kill: bool) -> bytes:
    """Print the cost of a batch, and return its results.csv."""
    folder.mkdir()
    journal = RowJournal(folder / JOURNAL, settings.key)
    try:
        if kill:
            timed(paths, workers, journal, settings, until=2 * len(paths) // 3)
            print(f"{workers} workers, one killed, and then all: {len(journal)} rows are there", flush=True)
        kept = len(journal)
        print(f"{workers} workers: {cost(timed(paths, workers, journal, settings), len(paths) - kept)}", flush=True)
        again = timed(paths, workers, journal, settings)
        print(f"  again, all there already: {cost(again, len(paths))}", flush=True)
        return write_tables(folder, journal.rows(paths))[1].read_bytes()
    finally:
        journal.close()


def main() -> None:
    """Measure the batches of the options."""
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
            paths = write_captures(Path(name), options.captures, options.of)
            size = sum(Path(path).stat().st_size for path in paths) / 1e6
            print(f"{len(paths)} captures, {size:.1f} MB", flush=True)
        for workers in options.workers:
            kill = options.kill and workers == options.workers[-1]
            tables.append(measured(Path(name) / f"out-{workers}", paths, workers, settings, kill))
    counts = Counter(row["verdict"] or "not read" for row in csv.DictReader(io.StringIO(tables[0].decode())))
    print(f"{dict(counts)}; results.csv the same by all workers: {all(each == tables[0] for each in tables)}")
    here, each = (resource.getrusage(who).ru_maxrss / 1024 for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    print(f"this program took {here:.0f} MB at most, a worker {each:.0f} MB")
