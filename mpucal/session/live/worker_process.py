"""Worker process for the fits of a session: the loop that reads the FIFO shares no interpreter with them.

The process reads pickled tasks from its stdin and writes pickled answers to its stdout.
"""

from __future__ import annotations

import os
import pickle
import sys
import traceback
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from typing import IO

from ...data import Sensor
from ...errors import Abandoned
from ..beside import describe_end, end_beside, start_beside
from ..events import Event
from ..plan import Plan
from .fits import Fits, Task

# The reading loop is scheduled before the fits.
NICENESS = 5


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
        os.nice(NICENESS)
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
