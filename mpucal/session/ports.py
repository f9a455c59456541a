"""What a session's runner meets: a source, a person, and who keeps session events in a capture."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from ..chip.records import KEY, SessionEvent
from ..data import Recording, Samples, Sensor
from .events import Key, Output


class Source(Protocol):
    """What delivers samples: the chip's driver, over whatever bus."""

    def start(self) -> Sensor:
        """Set the sensor up and begin to measure."""
        ...

    def poll(self) -> Samples:
        """Wait a little, and return the samples that came meanwhile; EndOfCapture if there will be none."""
        ...

    def recording(self) -> Recording:
        """All samples so far, with their final times."""
        ...

    def forget(self) -> None:
        """Let go of all samples so far: `recording` holds what comes from now on, for hours if need be."""
        ...

    def now_ns(self) -> int:
        """The source's clock, in which the samples' times are."""
        ...

    def stop(self) -> None:
        """Put the sensor to rest."""
        ...


class Talk(Protocol):
    """The person: who is told, and who says."""

    def hear(self, output: Output) -> None:
        """Be told."""
        ...

    def pressed(self) -> Sequence[Key]:
        """What was pressed since the last call; never waits."""
        ...


class Replayed:
    """The person in a capture: presses the recorded keys where they were pressed. Somebody else listens.

    Parameters
    ----------
    listener : hears, and may abort. pending : the session events of a name recorded since the last access, each once.
    """

    def __init__(self, listener: Talk, pending: Callable[[str], Sequence[SessionEvent]]) -> None:
        self._listener, self._pending = listener, pending

    def hear(self, output: Output) -> None:
        """Be told."""
        self._listener.hear(output)

    def pressed(self) -> Sequence[Key]:
        """The recorded keys, and a listener's abort."""
        recorded = [Key(event.data[KEY]) for event in self._pending(KEY)]
        return [*recorded, *(key for key in self._listener.pressed() if key is Key.ABORT)]


# keeps a session event in the capture: name, time [ns], data
Note = Callable[[str, int, Mapping[str, Any]], None]
