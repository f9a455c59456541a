"""Run of a batch: recordings go to dask's workers, a few hundred tasks at a time, and rows come back."""

from __future__ import annotations

import atexit
import logging
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ..errors import SourceError, UsageError
from ..files.reading import VARIABLE, allowed_bytes
from .journal import RowJournal
from .row import Settings, make_rows

# tasks of the scheduler at once: more are not faster, and take memory
UNDER_WAY = 256
# A task costs as much as ten milliseconds of calibration. Recordings per task, at most; tasks per worker, at least, so
# that no worker waits long for the last one.
MOST_PER_TASK, TASKS_PER_WORKER = 8, 16
JOURNAL = "rows.jsonl"
INSTALL = "pip install 'mpucal[batch]'"
WAIT_S = 60
DASK_CONFIG = {
    # A worker that died is restarted after seconds, on a busy machine after minutes. By default dask gives it up in
    # 15 s, which would leave its tasks undone.
    "distributed.deploy.lost-worker-timeout": "1 hour",
    # By default workers sample their own stacks, and return the memory of each array: a fifth of their time.
    "distributed.worker.profile.enabled": False,
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": None,
}


@dataclass(frozen=True)
class Progress:
    """Progress of a batch.

    Attributes
    ----------
    done, of : rows done, and all. kept, failed : of the rows done, those from an earlier run, and those with an error.
    seconds : since the start.
    """

    done: int
    of: int
    kept: int
    failed: int
    seconds: float

    @property
    def left_s(self) -> float | None:
        """Return the remaining time [s] at the pace so far; None if nothing is done yet."""
        made = self.done - self.kept
        return (self.of - self.done) * self.seconds / made if made else None


def run_batch(paths: Sequence[str], client: Any, journal: RowJournal, settings: Settings) -> Iterator[Progress]:
    """Fill the journal, and yield the progress after each row; a row of an unchanged file is kept.

    Raises
    ------
    SourceError : the scheduler was lost; finished rows stay in the journal.
    """
    from distributed import as_completed  # noqa: PLC0415

    begun, done, kept, failed = time.monotonic(), 0, 0, 0
    names = list(dict.fromkeys(paths))
    size = len(names) // (TASKS_PER_WORKER * max(len(client.ncores()), 1))
    size = min(max(size, 1), MOST_PER_TASK)
    todo, under_way = (names[first : first + size] for first in range(0, len(names), size)), {}
    suspects: list[str] = []
    alone = False
    results = as_completed(loop=client.loop, with_results=True, raise_errors=False)

    def send(tasks: Iterable[Sequence[str]]) -> None:
        for task in tasks:
            known = [journal.digest(path) for path in task]
            future = client.submit(make_rows, task, settings, known, pure=False)
            under_way[future.key] = task
            results.add(future)

    send(islice(todo, UNDER_WAY))
    for future, result in results:
        task = under_way.pop(future.key)
        if future.status == "lost":
            # its worker died before the result was fetched, but the scheduler works
            send([task])
            continue
        if future.status == "cancelled":
            raise SourceError("the scheduler was lost", "start it, and run the batch again: finished rows are kept")
        rows = result if future.status == "finished" else []
        if not rows and not alone:
            # one of these, or of those that waited with them, ended the worker: each is tried alone later
            suspects += task
        for row in rows or ([_worker_failure(task[0], result)] if alone else ()):
            if "batch" in row:
                journal.add(row)
            else:
                kept += 1
            done, failed = done + 1, failed + ("error" in row)
            yield Progress(done, len(names), kept, failed, time.monotonic() - begun)
        send(islice(todo, 1))
        if not under_way and suspects:
            alone = True
            send([[suspects.pop(0)]])


def _worker_failure(path: str, result: Any) -> dict[str, Any]:
    error = result[1] if isinstance(result, tuple) else result
    return {"path": path, "batch": Path(path).parent.name, "error": f"the workers died or could not run it: {error}"}


@contextmanager
def local_client(workers: int | None = None) -> Iterator[Any]:
    """Start workers on this machine, processes of one thread each.

    Raises
    ------
    SourceError : they could not be started. UsageError : dask.distributed or pyarrow is not installed.
    """
    distributed = _import_distributed()
    import dask  # noqa: PLC0415
    from distributed.deploy.spec import close_clusters  # noqa: PLC0415

    with TemporaryDirectory(prefix="mpucal-") as scratch, dask.config.set(DASK_CONFIG), ExitStack() as stack:
        try:
            cluster = distributed.LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                env={VARIABLE: str(allowed_bytes() >> 20)},
                local_directory=scratch,
                dashboard_address=":0",
                # its messages would only be about a worker that could not be started
                silence_logs="CRITICAL",
            )
            client = stack.enter_context(distributed.Client(stack.enter_context(cluster)))
        except (RuntimeError, OSError) as error:
            raise SourceError(
                f"the workers were ended while they started ({error})",
                "free memory for them, or give fewer --workers, and run the batch again",
            ) from error
        except KeyboardInterrupt:
            # Workers that have not started end with this process; closing them at its exit would only print a trace.
            atexit.unregister(close_clusters)
            raise
        yield client


@contextmanager
def remote_client(scheduler: str) -> Iterator[Any]:
    """Connect to the workers of a running scheduler.

    Raises
    ------
    SourceError : it does not answer, or has no workers. UsageError : dask.distributed or pyarrow is not installed.
    """
    distributed = _import_distributed()
    try:
        client = distributed.Client(scheduler, timeout=10, set_as_default=False)
    except (OSError, ValueError) as error:
        raise SourceError(f"no scheduler answers at {scheduler} ({error})", "start `dask scheduler`") from error
    with client:
        try:
            client.wait_for_workers(1, timeout=WAIT_S)
        except TimeoutError as error:
            raise SourceError(
                f"the scheduler at {scheduler} has no workers", f"start `dask worker {scheduler} --nthreads 1`"
            ) from error
        yield client


def _import_distributed() -> Any:
    try:
        import distributed  # noqa: PLC0415
        import pyarrow  # noqa: F401, PLC0415 - the table at the end needs it
    except ImportError as error:
        raise UsageError(f"{error.name} is not installed", INSTALL) from error
    # run_batch reports lost workers in one sentence
    for name in ("distributed.client", "tornado.application", "asyncio"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    return distributed
