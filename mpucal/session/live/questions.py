"""The requests of a session to its live fits, and when their answers are brought.

What is asked for after so many samples is brought after a fixed number more, and waited for if it is late: what the
session does then depends on the samples alone, and a replay repeats it to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Protocol

from ...data import Samples, Sensor
from ..events import Ask, Event
from ..plan import Plan
from .fits import Fits, Task


class Worker(Protocol):
    """Whoever does the tasks of one session, in their order."""

    def submit(self, task: Task) -> Future[Event | None]:
        """Have it done; never waits."""
        ...

    def close(self) -> None:
        """Stop, whatever is being done."""
        ...


class Here:
    """Does each task at once, where time waits for it: a replay, or a simulation as fast as it goes."""

    def __init__(self, plan: Plan, sensor: Sensor) -> None:
        self._fits = Fits(plan, sensor)

    def submit(self, task: Task) -> Future[Event | None]:
        """See Worker; it is done when this returns."""
        answer: Future[Event | None] = Future()
        answer.set_result(self._fits.do(task))
        return answer

    def close(self) -> None:
        """See Worker."""


@dataclass(frozen=True)
class _Due:
    """An answer, and the number of samples after which it is brought."""

    at: int
    answer: Future[Event | None]


class Questions:
    """One session's; `close` them in the end.

    Parameters
    ----------
    plan : what the session is to do. sensor : what it measures with. hire : begins who does the tasks.
    """

    def __init__(self, plan: Plan, sensor: Sensor, hire: Callable[[Plan, Sensor], Worker] = Here) -> None:
        self._rate_hz = sensor.rate_hz or 200.0
        self._worker = hire(plan, sensor)
        self._untold: list[Samples] = []
        self._count = 0
        self._asked: list[_Due] = []

    def add(self, samples: Samples) -> None:
        """They arrived."""
        self._untold.append(samples)
        self._count += len(samples)

    def ask(self, ask: Ask) -> None:
        """Begin to compute."""
        at = self._count + round(ask.wait_s * self._rate_hz)
        self._asked.append(_Due(at, self._worker.submit(Task(self._news(), ask.wish))))

    @property
    def due(self) -> bool:
        """Whether an answer is to be brought now."""
        return any(item.at <= self._count for item in self._asked)

    @property
    def late(self) -> bool:
        """Whether an answer is to be brought now and is not there."""
        return any(item.at <= self._count and not item.answer.done() for item in self._asked)

    def answers(self) -> Sequence[Event]:
        """What is due by now; waits for what is late.

        Raises
        ------
        Abandoned : who computes has died.
        """
        due = [item for item in self._asked if item.at <= self._count]
        self._asked = [item for item in self._asked if item.at > self._count]
        answers = [item.answer.result() for item in due]
        return [answer for answer in answers if answer is not None]

    def forget(self, first: int) -> None:
        """The samples from number `first` on are not used; nor is what was computed of them."""
        for item in self._asked:
            item.answer.cancel()
        self._asked = []
        self._worker.submit(Task(self._news(), forget=first))

    def close(self) -> None:
        """Stop computing."""
        self._worker.close()

    def _news(self) -> Samples:
        news, self._untold = Samples.joined(self._untold), []
        return news
