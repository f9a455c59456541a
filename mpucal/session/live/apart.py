"""The fits of a session in a process of their own: the loop that reads the FIFO shares no interpreter with them.

The process is told tasks and tells answers, pickled, over its stdin and stdout. It ends with the program, however that
ends: then nothing more comes from its stdin.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import traceback
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from typing import IO

from ...data import Sensor
from ...errors import Abandoned
from ..events import Event
from ..plan import Plan
from ..threads import ONE_THREAD
from .fits import Fits, Task

# the reading loop goes first
NICER = 5


class Apart:
    """Has the tasks done by a process, which is begun at once and killed by `close`.

    Attributes
    ----------
    pid : the process's.
    """

    def __init__(self, plan: Plan, sensor: Sensor) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", __name__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            # what this program imports is imported from the same places
            env={**os.environ, **ONE_THREAD, "PYTHONPATH": os.pathsep.join(sys.path)},
            # Ctrl-C is for the session, which ends this process too
            process_group=0,
        )
        self.pid = self._process.pid
        # it waits in place of the loop
        self._line = ThreadPoolExecutor(max_workers=1, thread_name_prefix="fits")
        self._line.submit(self._tell, (plan, sensor))

    def submit(self, task: Task) -> Future[Event | None]:
        """See Worker.

        The answer may raise Abandoned, where the process ended, and whatever the fit raised.
        """
        return self._line.submit(self._asked, task)

    def close(self) -> None:
        """See Worker."""
        self._process.kill()
        self._line.shutdown(wait=True, cancel_futures=True)
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with suppress(OSError):
                    pipe.close()

    def _asked(self, task: Task) -> Event | None:
        try:
            self._tell(task)
            answer: Event | Exception | None = pickle.load(_of(self._process.stdout))
        except (EOFError, OSError, pickle.UnpicklingError):
            raise Abandoned(
                f"the process that computes beside the measuring {self._how_it_ended()}",
                "see that the computer has memory to spare, and go on with --resume",
            ) from None
        if isinstance(answer, Exception):
            raise answer
        return answer

    def _tell(self, what: object) -> None:
        pipe = _of(self._process.stdin)
        pickle.dump(what, pipe)
        pipe.flush()

    def _how_it_ended(self) -> str:
        code = self._process.wait()
        return f"was killed by signal {-code}" if code < 0 else f"ended with exit code {code}"


def serve() -> None:
    """What the process does: one answer a task, until there are no more."""
    tasks, answers = sys.stdin.buffer, sys.stdout.buffer
    # whatever prints must not get between the answers
    sys.stdout = sys.stderr
    if hasattr(os, "nice"):
        os.nice(NICER)
    with suppress(EOFError, BrokenPipeError):
        fits = Fits(*pickle.load(tasks))
        while True:
            pickle.dump(_done(fits, pickle.load(tasks)), answers)
            answers.flush()


def _done(fits: Fits, task: Task) -> Event | Exception | None:
    """The answer, or what went wrong, which is raised where the answer is read."""
    try:
        return fits.do(task)
    except Exception as error:
        error.add_note(f"in the process of the fits:\n{traceback.format_exc()}")
        return error


def _of(pipe: IO[bytes] | None) -> IO[bytes]:
    if pipe is None:
        raise EOFError
    return pipe


if __name__ == "__main__":
    serve()
