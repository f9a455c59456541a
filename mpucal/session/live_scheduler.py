"""Schedule of a session's fits: requests go to a worker, and answers come back after a fixed number of samples.

An answer that is late is waited for. So the session depends on the samples alone, and a replay repeats it to the last
bit.
"""

from __future__ import annotations

import os
import pickle
import sys
import traceback
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from typing import IO, NamedTuple, Protocol

from ..data import Samples, Sensor
from ..errors import Abandoned
from .beside import describe_end, end_beside, start_beside
from .events import Event, RequestFit
from .live_fits import Fits, Task
from .plan import Plan


class Worker(Protocol):
    """Executes fit tasks in the order in which they were submitted."""

    def submit(self, task: Task) -> Future[Event | None]:
        """Queue a task; never waits."""

    def close(self) -> None:
        """Stop, and drop the tasks that are not done."""


class InlineWorker:
    """Worker that executes each task at once: for replays, and for simulations as fast as they go."""

    def __init__(self, plan: Plan, sensor: Sensor) -> None:
        self._fits = Fits(plan, sensor)

    def submit(self, task: Task) -> Future[Event | None]:
        """Execute a task; it is done when this returns."""
        answer: Future[Event | None] = Future()
        answer.set_result(self._fits.do(task))
        return answer

    def close(self) -> None:
        """Do nothing: no task is left."""


class _Pending(NamedTuple):
    """An answer, and the number of samples after which it is due."""

    due_at: int
    answer: Future[Event | None]


class FitScheduler:
    """Requests and answers of one session; `close` it in the end.

    Parameters
    ----------
    plan : the session's settings. sensor : the sensor that it measures with.
    start_worker : makes the worker that executes the fits.
    """

    def __init__(
        self, plan: Plan, sensor: Sensor, start_worker: Callable[[Plan, Sensor], Worker] = InlineWorker
    ) -> None:
        self._rate_hz = sensor.rate_hz or 200.0
        self._worker = start_worker(plan, sensor)
        self._unsent: list[Samples] = []
        self._count = 0
        self._pending: list[_Pending] = []

    def add(self, samples: Samples) -> None:
        """Queue new samples for the worker."""
        self._unsent.append(samples)
        self._count += len(samples)

    def request(self, request: RequestFit) -> None:
        """Submit a fit of all samples so far."""
        due_at = self._count + round(request.wait_s * self._rate_hz)
        self._pending.append(
            _Pending(due_at, self._worker.submit(Task(self._take_unsent(), request.kind, of=request.of)))
        )

    @property
    def due(self) -> bool:
        """True if an answer belongs here, after the samples so far."""
        return any(item.due_at <= self._count for item in self._pending)

    @property
    def late(self) -> bool:
        """True if an answer belongs here and is not computed yet."""
        return any(item.due_at <= self._count and not item.answer.done() for item in self._pending)

    def answers(self) -> Sequence[Event]:
        """Return the answers that are due; wait for those that are late.

        Raises
        ------
        Abandoned : the worker's process has died.
        """
        due = [item for item in self._pending if item.due_at <= self._count]
        self._pending = [item for item in self._pending if item.due_at > self._count]
        answers = [item.answer.result() for item in due]
        return [answer for answer in answers if answer is not None]

    def forget(self, first: int) -> None:
        """Drop the samples from number `first` on, and every fit of them."""
        for item in self._pending:
            item.answer.cancel()
        self._pending = []
        self._worker.submit(Task(self._take_unsent(), forget=first))

    def close(self) -> None:
        """Stop the worker."""
        self._worker.close()

    def _take_unsent(self) -> Samples:
        unsent, self._unsent = Samples.joined(self._unsent), []
        return unsent


class ProcessWorker:
    """Worker that executes the tasks in a process, which it starts at once and which `close` kills.

    Attributes
    ----------
    pid : process id.
    """

    def __init__(self, plan: Plan, sensor: Sensor) -> None:
        self._process = start_beside(__name__)
        self.pid = self._process.pid
        # This thread waits for answers, so that the loop does not.
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="fits")
        self._thread.submit(self._send, (plan, sensor))

    def submit(self, task: Task) -> Future[Event | None]:
        """Queue a task.

        The answer raises Abandoned if the process has ended, and whatever the fit raised.
        """
        return self._thread.submit(self._request, task)

    def close(self) -> None:
        """Kill the process, and drop the tasks that are not done."""
        self._process.kill()
        self._thread.shutdown(wait=True, cancel_futures=True)
        end_beside(self._process)

    def _request(self, task: Task) -> Event | None:
        try:
            self._send(task)
            answer: Event | Exception | None = pickle.load(_open_pipe(self._process.stdout))
        except (EOFError, OSError, pickle.UnpicklingError):
            ended = describe_end(self._process.wait())
            raise Abandoned(
                f"the process that computes the fits {ended}", "free some memory, and continue with --resume"
            ) from None
        if isinstance(answer, Exception):
            raise answer
        return answer

    def _send(self, message: object) -> None:
        pipe = _open_pipe(self._process.stdin)
        pickle.dump(message, pipe)
        pipe.flush()


def serve() -> None:
    """Answer one task after another until stdin is closed; the main function of the process."""
    tasks, answers = sys.stdin.buffer, sys.stdout.buffer
    # Output of print must not get between the answers.
    sys.stdout = sys.stderr
    if hasattr(os, "nice"):
        # The reading loop is scheduled before the fits.
        os.nice(5)
    with suppress(EOFError, BrokenPipeError):
        fits = Fits(*pickle.load(tasks))
        while True:
            pickle.dump(_execute(fits, pickle.load(tasks)), answers)
            answers.flush()


def _execute(fits: Fits, task: Task) -> Event | Exception | None:
    """Return the answer, or the exception, which is raised where the answer is read."""
    try:
        return fits.do(task)
    except Exception as error:
        error.add_note(f"in the process of the fits:\n{traceback.format_exc()}")
        return error


def _open_pipe(pipe: IO[bytes] | None) -> IO[bytes]:
    if pipe is None:
        raise EOFError
    return pipe


if __name__ == "__main__":
    serve()
