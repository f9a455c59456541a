"""Tasks in forked processes, which may crash, hang or be killed: what they tell, and how they ended."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator
from multiprocessing.connection import wait
from typing import Any, NamedTuple

Tell = Callable[[Any], None]
Task = Callable[[Tell], None]


class Died(NamedTuple):
    """A task ended otherwise than by its own end: with this exit code, or below 0 by this signal."""

    code: int


def forked(tasks: list[Task], jobs: int) -> Iterator[tuple[Task, Any]]:
    """A task and what it told, as it comes; last a Died where it died. Tasks may be added to the list meanwhile."""
    fork, running = multiprocessing.get_context("fork"), {}
    while tasks or running:
        while tasks and len(running) < jobs:
            hear, tell = fork.Pipe(duplex=False)
            process = fork.Process(target=tasks[0], args=(tell.send,))
            running[hear] = process, tasks.pop(0)
            process.start()
            tell.close()
        for hear in wait(running):
            process, task = running[hear]
            try:
                yield task, hear.recv()
            except EOFError:
                process.join()
                del running[hear]
                hear.close()
                if process.exitcode:
                    yield task, Died(process.exitcode)
