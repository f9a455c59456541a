"""The scaling of `mpucal batch`: rows a second by workers, the engine's cost of a row, and of a row that is there.

python -m tools.bench batch_scale --workers 1 2 -- sessions/*/capture.mcap
python -m tools.bench batch_scale --engine-only 2000

With --engine-only there are no recordings to read: what is left is the engine and the journal.
"""

import resource
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import psutil

from mpucal.batch.journal import RowJournal
from mpucal.batch.many import JOURNAL, local_client, run_batch
from mpucal.batch.row import Settings, make_row
from mpucal.batch.table import write_tables

from .timing import used

SESSION = Path(__file__).parents[2] / "fixtures" / "sessions" / "mpu6050.mcap"
SETTINGS = Settings("auto", 9.80665)


def cost(paths: list[str], workers: int, journal: RowJournal) -> str:
    """Run a batch on workers of its own, and return the cost of its rows in words."""
    with local_client(workers) as client:
        client.wait_for_workers(workers)
        # loads the imports of a first row
        client.run(make_row, str(SESSION), SETTINGS)
        children = psutil.Process().children(recursive=True)
        with used(lambda: sum(sum(one.cpu_times()[:2]) for one in children if one.is_running())) as time:
            for _ in run_batch(paths, client, journal, SETTINGS):
                pass
    program_ms, workers_ms = (1e3 * x / len(paths) for x in (time.cpu_s, time.children_s))
    of = f"of a processor a row: program and scheduler {program_ms:.2f} ms, workers {workers_ms:.2f} ms"
    return f"{len(paths) / time.wall_s:.2f} rows/s; {of}"


def main(
    captures: Annotated[Sequence[Path], "recordings"] = (),
    *,
    workers: Sequence[int] = (1, 2),
    engine_only: Annotated[int, "so many recordings that are not there"] = 0,
) -> None:
    """Measure the batches of the options."""
    tables = set()
    with tempfile.TemporaryDirectory() as name:
        paths = [*map(str, captures), *(f"{name}/none/{i}.mcap" for i in range(engine_only))]
        for count in workers:
            (folder := Path(name) / f"out-{count}").mkdir()
            journal = RowJournal(folder / JOURNAL, SETTINGS.key)
            for what in (f"{count} workers", "  again, all there already"):
                print(f"{what}: {cost(paths, count, journal)}", flush=True)
            tables.add(write_tables(folder, journal.rows(paths))[1].read_bytes())
            journal.close()
    print(f"results.csv the same by all workers: {len(tables) == 1}")
    here, each = (resource.getrusage(who).ru_maxrss / 1024 for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    print(f"this program took {here:.0f} MB at most, a worker {each:.0f} MB")
