"""Interfaces of a session's runner: the source, the operator, and the notes of session events in the capture."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Protocol

from ..chip.access import KEY, SessionEvent
from ..data import Recording, Samples, Sensor
from .events import Key, Output


class Source(Protocol):
    """Source of samples, such as a chip's driver over any bus."""

    def start(self) -> Sensor:
        """Set the sensor up, and start to measure."""

    def poll(self) -> Samples:
        """Wait a little, and return the samples that came meanwhile; EndOfCapture if no more will come."""

    def recording(self) -> Recording:
        """Return all samples so far, with their final times."""

    def forget(self) -> None:
        """Drop all samples so far, so that memory lasts for hours."""

    def now_ns(self) -> int:
        """Return the time of the clock that the samples' times are in."""

    def stop(self) -> None:
        """Stop measuring, and put the sensor to rest."""


def polled(source: Source, seconds: float | None = None) -> Iterator[Samples]:
    """Poll a started source for `seconds` of its time, or without an end; yield the samples of each poll.

    Raises
    ------
    EndOfCapture : no more will come.
    """
    end_ns = math.inf if seconds is None else source.now_ns() + seconds * 1e9
    while source.now_ns() < end_ns:
        yield source.poll()


def measured(source: Source, seconds: float) -> Recording:
    """Poll a started source for `seconds` of its time; return the samples since the last `forget`; see `polled`."""
    for _ in polled(source, seconds):
        pass
    return source.recording()


class Operator(Protocol):
    """The person who follows the prompts and presses keys."""

    def hear(self, output: Output) -> None:
        """Show an output."""

    def pressed(self) -> Sequence[Key]:
        """Return the keys that were pressed since the last call; never waits."""


class ReplayedOperator:
    """Operator of a replay: the recorded keys are pressed in their places, and a listener gets the outputs.

    Parameters
    ----------
    listener : gets the outputs, and may abort.
    pending : returns the session events of a name recorded since the last access, each once.
    resumed : of a session that is resumed: returns True once the replay is over. The listener then presses the keys,
        and it gets the outputs from there on.
    """

    def __init__(
        self,
        listener: Operator,
        pending: Callable[[str], Sequence[SessionEvent]],
        resumed: Callable[[], bool] | None = None,
    ) -> None:
        self._listener, self._pending, self._resumed = listener, pending, resumed

    def hear(self, output: Output) -> None:
        """Pass an output to the listener."""
        if self._resumed is None or self._resumed():
            self._listener.hear(output)

    def pressed(self) -> Sequence[Key]:
        """Return the recorded keys, and the listener's abort."""
        pressed = self._listener.pressed()
        if self._resumed is not None and self._resumed():
            return pressed
        recorded = [Key(event.data[KEY]) for event in self._pending(KEY)]
        return [*recorded, *(key for key in pressed if key is Key.ABORT)]


# Writes a session event into the capture: name, time [ns], data.
Note = Callable[[str, int, Mapping[str, Any]], None]
