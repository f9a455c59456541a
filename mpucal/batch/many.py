"""The batch itself: recordings to dask's workers, a few hundred tasks at a time, and rows back as they come."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ..data import STANDARD_GRAVITY_MPS2
from ..disk.folder import Folder
from ..errors import SourceError, UsageError
from .journal import Journal
from .row import Settings, rows_of

# tasks that the scheduler knows of at once: more are no faster, and take memory
UNDER_WAY = 256
# recordings of a task, which costs as much as ten milliseconds of calibrating: at most, and so that each worker has
# so many tasks that none waits long for the last
MOST_OF_A_TASK, TASKS_OF_A_WORKER = 8, 16
JOURNAL = "rows.jsonl"
INSTALL = "pip install 'mpucal[batch]'"
WAIT_S = 60
# a worker that died is there again after seconds, and on a busy machine after minutes: until then dask must not give it
# up, as by itself after 15 s, or nobody takes what is left
COMES_BACK = {"distributed.deploy.lost-worker-timeout": "1 hour"}


@dataclass(frozen=True)
class Progress:
    """How far a batch is: rows done of so many, of which so many were there already or could not be read; s."""

    done: int
    of: int
    kept: int
    failed: int
    seconds: float

    @property
    def left_s(self) -> float | None:
        """How long it still takes at the pace so far."""
        made = self.done - self.kept
        return (self.of - self.done) * self.seconds / made if made else None


def calibrate_many(
    paths: Sequence[str | Path],
    client: Any = None,
    *,
    model: str = "auto",
    gravity: float = STANDARD_GRAVITY_MPS2,
    folder: str | Path | None = None,
) -> Any:
    """Calibrate many recordings; a pyarrow.Table with a row for each, in their order.

    Parameters
    ----------
    paths : files, folders of sessions, or URLs of fsspec, read where the worker is.
    client : a distributed.Client; None: workers of this machine, one for each processor.
    model, gravity : see mpucal.calibrate.
    folder : where what is done is kept, so that the next call goes on there.

    Raises
    ------
    SourceError : the scheduler was lost. OutputError : `folder` cannot be written, or another batch writes to it.
    UsageError : dask.distributed or pyarrow is not installed.
    """
    from .table import table_of  # noqa: PLC0415

    names, settings = [str(path) for path in paths], Settings(model, gravity)
    with TemporaryDirectory() as temporary, local_client() if client is None else _as_is(client) as workers:
        place = Path(folder or temporary)
        with Folder(place), closing(Journal(place / JOURNAL, settings.key)) as journal:
            for _ in run(names, workers, journal, settings):
                pass
            return table_of(journal.rows(names))


def run(paths: Sequence[str], client: Any, journal: Journal, settings: Settings) -> Iterator[Progress]:
    """Fill the journal; what it holds already of the same file is only compared by digest.

    Raises
    ------
    SourceError : the scheduler was lost; what is done stays in the journal.
    """
    from distributed import as_completed  # noqa: PLC0415

    begun, done, kept, failed = time.monotonic(), 0, 0, 0
    names = list(dict.fromkeys(paths))
    size = len(names) // (TASKS_OF_A_WORKER * max(len(client.ncores()), 1))
    todo, under_way = _batched(names, min(max(size, 1), MOST_OF_A_TASK)), {}
    suspects: list[str] = []
    alone = False
    results = as_completed(loop=client.loop, with_results=True, raise_errors=False)

    def send(tasks: Iterable[Sequence[str]]) -> None:
        for task in tasks:
            known = [journal.digest(path) for path in task]
            future = client.submit(rows_of, task, settings, known, pure=False)
            under_way[future.key] = task
            results.add(future)

    send(islice(todo, UNDER_WAY))
    for future, result in results:
        task = under_way.pop(future.key)
        if future.status == "lost":
            # its worker died before the result was fetched; the scheduler lives
            send([task])
            continue
        if future.status == "cancelled":
            raise SourceError("the scheduler was lost", "start it, and run the same again: what is done stays done")
        rows = result if future.status == "finished" else []
        if not rows and not alone:
            # which of these, or of those that waited beside them, it was shows where each is alone
            suspects += task
        for row in rows or ([_died(task[0], result)] if alone else ()):
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


def _batched(names: Sequence[str], size: int) -> Iterator[Sequence[str]]:
    """The names, so many at a time."""
    return (names[first : first + size] for first in range(0, len(names), size))


def _died(path: str, result: Any) -> dict[str, Any]:
    error = result[1] if isinstance(result, tuple) else result
    return {"path": path, "batch": Path(path).parent.name, "error": f"its workers died or could not run it: {error}"}


@contextmanager
def local_client(workers: int | None = None, dashboard: bool = False) -> Iterator[Any]:
    """Workers of this machine, processes of one thread each.

    Raises
    ------
    SourceError : they could not be started. UsageError : dask.distributed or pyarrow is not installed.
    """
    distributed = _distributed()
    import dask  # noqa: PLC0415

    with (
        TemporaryDirectory(prefix="mpucal-") as scratch,
        dask.config.set(COMES_BACK),
        ExitStack() as stack,
    ):
        try:
            cluster = distributed.LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                local_directory=scratch,
                dashboard_address=":8787" if dashboard else ":0",
                # its own lines would be of a worker that could not be started
                silence_logs="CRITICAL",
            )
            client = stack.enter_context(distributed.Client(stack.enter_context(cluster)))
        except (RuntimeError, OSError) as error:
            raise SourceError(
                f"the workers were ended while they started ({error})",
                "see to it that there is memory for them, or give fewer --workers, and run the same again",
            ) from error
        yield client


@contextmanager
def remote_client(scheduler: str) -> Iterator[Any]:
    """The workers of a scheduler that runs already.

    Raises
    ------
    SourceError : it does not answer, or has no workers. UsageError : dask.distributed or pyarrow is not installed.
    """
    distributed = _distributed()
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


@contextmanager
def _as_is(client: Any) -> Iterator[Any]:
    yield client


def _distributed() -> Any:
    try:
        import distributed  # noqa: PLC0415
        import pyarrow  # noqa: F401, PLC0415 - for the table, which comes last
    except ImportError as error:
        raise UsageError(f"{error.name} is not installed", INSTALL) from error
    # what died is told in one sentence, by whoever lost it
    for name in ("distributed.client", "tornado.application"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    return distributed
