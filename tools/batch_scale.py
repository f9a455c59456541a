"""How `mpucal batch` scales: rows a second by workers, what the engine costs a row, and a long run with bad files.

python tools/batch_scale.py --captures 200 --workers 1 2
python tools/batch_scale.py --captures 10000 --workers 2 --engine-only

Synthetic captures: a stored session's accesses with every board's own bias, that is with other counts in its FIFO
frames; one in each hundred is cut, and one is junk. With --engine-only they hold three seconds, which are refused at
once: what is left is reading, the engine and the journal.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from mpucal.batch.journal import Journal
from mpucal.batch.many import JOURNAL, Progress, local_client, run
from mpucal.batch.row import Settings, row_of
from mpucal.batch.table import write
from mpucal.chip import registers as reg
from mpucal.chip.access import Transaction
from mpucal.files.mcap import CaptureWriter, read_capture

SESSION = Path(__file__).parents[1] / "fixtures" / "sessions" / "mpu6050.mcap"
SHORT_NS = 3_000_000_000


def write_captures(folder: Path, count: int, short: bool) -> list[str]:
    """That many captures, of which each hundred has one that is cut and one that is junk."""
    capture, rng = read_capture(SESSION), np.random.default_rng(1)
    records = [each for each in capture.records if not short or each.t_ns < capture.records[0].t_ns + SHORT_NS]
    paths = []
    for i in range(count):
        path = folder / f"{i:06d}.mcap"
        bias = np.concatenate((rng.normal(0, 100, 3), [0], rng.normal(0, 20, 3))).round().astype(np.int32)
        with CaptureWriter(path) as writer:
            writer.start(capture.meta)
            for each in records:
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


def timed(folder: Path, paths: list[str], workers: int, settings: Settings) -> tuple[float, Progress]:
    """Seconds of a batch on so many workers, once they are there, and how it ended."""
    journal = Journal(folder / JOURNAL, settings.key)
    with local_client(workers) as client:
        client.wait_for_workers(workers)
        # what a worker imports with its first row
        client.run(row_of, str(folder / "none.mcap"), settings)
        begun = time.perf_counter()
        *_, last = run(paths, client, journal, settings)
        seconds = time.perf_counter() - begun
    write(folder, journal.rows(paths))
    journal.close()
    return seconds, last


def main() -> None:
    """Measure what the options name."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--captures", type=int, default=100)
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--model", default="auto")
    parser.add_argument("--engine-only", action="store_true", help="captures of three seconds, refused at once")
    options = parser.parse_args()
    settings = Settings(options.model, 9.80665)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        begun = time.perf_counter()
        paths = write_captures(folder, options.captures, options.engine_only)
        size = sum(Path(path).stat().st_size for path in paths) / 1e6
        print(f"{len(paths)} captures, {size:.1f} MB, written in {time.perf_counter() - begun:.0f} s", flush=True)
        few = paths[:20]
        begun, processor = time.perf_counter(), time.process_time()
        for path in few:
            row_of(path, settings)
        alone, alone_cpu = (each / len(few) for each in (time.perf_counter() - begun, time.process_time() - processor))
        print(f"one after the other: {1e3 * alone:.1f} ms a row, {1e3 * alone_cpu:.1f} ms of a processor", flush=True)
        for workers in options.workers:
            place = folder / f"out-{workers}"
            place.mkdir()
            seconds, last = timed(place, paths, workers, settings)
            each_ms = 1e3 * seconds * workers / last.done
            print(
                f"{workers} workers: {last.done / seconds:.2f} rows/s, {each_ms:.1f} ms of a worker a row", flush=True
            )
            print(f"  {last.failed} unreadable", flush=True)
            seconds, last = timed(place, paths, workers, settings)
            print(f"  again, all done: {1e3 * seconds / last.done:.2f} ms a row, {last.kept} kept", flush=True)


if __name__ == "__main__":
    main()
