"""What happens to a session and what it answers, as plain values. Knows no rule of what follows what."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from ..data import Samples, Sensor

Direction = tuple[float, float, float]


class Key(StrEnum):
    """What the person can say."""

    ENOUGH = "enough"
    ABORT = "abort"


# What happens to a session.


@dataclass(frozen=True)
class Connected:
    """The sensor answered and measures."""

    sensor: Sensor


@dataclass(frozen=True)
class Measured:
    """Samples arrived; they carry the session's time."""

    samples: Samples


@dataclass(frozen=True)
class Tick:
    """The source was asked and the time is `t_s`, on the clock of the samples' times."""

    t_s: float


@dataclass(frozen=True)
class Enough:
    """The person says to go on now."""


@dataclass(frozen=True)
class Abort:
    """The person wants to stop."""


@dataclass(frozen=True)
class SourceEnded:
    """No more samples will come; `why` is None where a recording came to its end, else what failed."""

    why: str | None = None


@dataclass(frozen=True)
class Fitted:
    """The calibration is there, with its verdict: good, usable or refused."""

    verdict: str


@dataclass(frozen=True)
class Written:
    """The results are in their files."""

    names: tuple[str, ...]


# What the session itself finds in the above; they drive its table like the rest.


@dataclass(frozen=True)
class Rested:
    """The board lay still for long enough; `acc` is the mean acceleration meanwhile [m/s^2]."""

    still_s: float
    acc: Direction


@dataclass(frozen=True)
class Turned:
    """The board was turned enough, or as much as it will be."""

    why: str


@dataclass(frozen=True)
class Stopped:
    """The session cannot go on or shall not; `why` says what happened, `remedy` what to do next."""

    why: str
    remedy: str


Event = Connected | Measured | Tick | Enough | Abort | SourceEnded | Fitted | Written | Rested | Turned | Stopped


# What the session answers.


class PromptKind(StrEnum):
    """What the person (or the hand that stands in for one) is to do now."""

    LAY_FLAT = "lay_flat"
    ROTATE = "rotate"
    REST = "rest"


@dataclass(frozen=True)
class Prompt:
    """An instruction to the person.

    Attributes
    ----------
    kind : what to do. text : the same in words.
    down : unit vector in the board's axes that is to point down, where one orientation is wanted.
    """

    kind: PromptKind
    text: str
    down: Direction | None = None


@dataclass(frozen=True)
class Progress:
    """How far the present step is: `done` of `of`, in words; `t_s` is the session's time."""

    t_s: float
    done: float
    of: float
    text: str


@dataclass(frozen=True)
class Decision:
    """The session went on to its next state, or ended: `why`, and where it ended early, what to do next."""

    why: str
    remedy: str = ""


Output = Prompt | Progress | Decision
