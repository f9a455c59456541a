"""Interface of an open source of any kind."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from ..origin import Origin
from ..session.events import Prompt
from ..session.plan import Plan
from ..session.ports import Note, Operator, Source

Say = Callable[[str], None]


class ActiveSource(NamedTuple):
    """Source that is being recorded.

    Attributes
    ----------
    note : records session events with it. go_on : begins its next part; False if there is none.
    late : decides to wait for an answer that is late now, or is not; see Runner.
    """

    source: Source
    note: Note
    go_on: Callable[[], bool] = lambda: False
    late: Callable[[bool], bool] = bool


class OpenedSource(Protocol):
    """Open source, with the properties of its kind.

    Attributes
    ----------
    plan : of the session. origin : of its samples. listeners : receive the prompts besides the operator.
    truth : true parameters of a simulated sensor. recovered : description of a damaged capture's readable part.
    capture_name : name of its capture's file.
    real_time : True if its time passes by itself, False if it waits for the program.
    resumable : True if a session on it can be resumed from its capture.
    """

    @property
    def plan(self) -> Plan: ...  # noqa: D102 - see above

    @property
    def origin(self) -> Origin: ...  # noqa: D102

    @property
    def listeners(self) -> Sequence[Callable[[Prompt], None]]: ...  # noqa: D102

    @property
    def truth(self) -> Mapping[str, Any] | None: ...  # noqa: D102

    @property
    def recovered(self) -> str | None: ...  # noqa: D102

    @property
    def capture_name(self) -> str: ...  # noqa: D102

    @property
    def real_time(self) -> bool: ...  # noqa: D102

    @property
    def resumable(self) -> bool: ...  # noqa: D102

    def talk(self, person: Operator) -> Operator:
        """Return the operator who presses the keys: the given one, or the one in the capture."""
        ...

    def measuring(self, capture: Path, say: Say, recorded: str) -> AbstractContextManager[ActiveSource]:
        """Record the source into `capture` during a `with` block; both are closed at its end.

        Parameters
        ----------
        say : shows a sentence to the operator. recorded : time of day for the capture's head.

        Raises
        ------
        CaptureError : a replay ended before its capture did.
        """
        ...
