"""What every open source has, whatever its kind."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from ..session.events import Prompt
from ..session.plan import Plan
from ..session.ports import Note, Operator, Source

Say = Callable[[str], None]


def never_on() -> bool:
    """A source in one part does not go on after its end."""
    return False


class ActiveSource(NamedTuple):
    """A source that is being recorded.

    Attributes
    ----------
    note : keeps session events beside it. go_on : begins its next part.
    late : whether to wait for an answer that is late now, or is not; see Runner.
    """

    source: Source
    note: Note
    go_on: Callable[[], bool] = never_on
    late: Callable[[bool], bool] = bool


class OpenedSource(Protocol):
    """A source, open, and what comes with its kind.

    Attributes
    ----------
    plan : what to do with it. listeners : hear the prompts besides the person.
    truth : of a simulated sensor. recovered : how much of a damaged capture it holds.
    capture_name : of the file that its kind is recorded into.
    real_time : its time passes by itself, and waits for nobody.
    resumable : what is recorded of it can be gone on with.
    """

    @property
    def plan(self) -> Plan: ...  # noqa: D102 - see above

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
        """Who presses the keys: the person, or the person in the capture."""
        ...

    def measuring(self, capture: Path, say: Say, recorded: str) -> AbstractContextManager[ActiveSource]:
        """The source, recorded into `capture`; whatever happens, both are closed.

        Parameters
        ----------
        say : tells the person a sentence. recorded : the time of day, for the capture's head.

        Raises
        ------
        CaptureError : a replay came to its end before its capture did.
        """
        ...
