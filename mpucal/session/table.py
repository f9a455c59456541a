"""Which event leads from which state to which: all about transitions, nothing about why they happen."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from types import MappingProxyType

from .events import (
    Abort,
    Connected,
    Enough,
    Event,
    Fitted,
    Measured,
    Rested,
    SourceEnded,
    Stopped,
    Tick,
    Turned,
    Written,
)


class State(StrEnum):
    """Where a session is."""

    CONNECT = "connect"
    LAY_FLAT = "lay flat"
    ROTATE = "rotate"
    CALIBRATE = "calibrate"
    WRITE = "write"
    DONE = "done"
    ABORTED = "aborted"


# An event that a row does not name is illegal in that state.
TRANSITIONS: Mapping[State, Mapping[type[Event], State]] = MappingProxyType(
    {
        State.CONNECT: {
            Connected: State.LAY_FLAT,
            Enough: State.CONNECT,
            SourceEnded: State.ABORTED,
            Abort: State.ABORTED,
        },
        State.LAY_FLAT: {
            Measured: State.LAY_FLAT,
            Tick: State.LAY_FLAT,
            Enough: State.LAY_FLAT,
            Rested: State.ROTATE,
            Stopped: State.ABORTED,
            SourceEnded: State.ABORTED,
            Abort: State.ABORTED,
        },
        State.ROTATE: {
            Measured: State.ROTATE,
            Tick: State.ROTATE,
            Turned: State.CALIBRATE,
            Enough: State.CALIBRATE,
            SourceEnded: State.CALIBRATE,
            Abort: State.ABORTED,
        },
        State.CALIBRATE: {
            Fitted: State.WRITE,
            Enough: State.CALIBRATE,
            Abort: State.ABORTED,
        },
        State.WRITE: {
            Written: State.DONE,
            Enough: State.WRITE,
            Abort: State.ABORTED,
        },
        State.DONE: {},
        State.ABORTED: {},
    }
)


class IllegalEvent(Exception):  # noqa: N818 - named by what went wrong
    """The machine's owner gave it an event that its state does not know: a bug of the owner."""


def next_state(state: State, event: Event) -> State:
    """Where `event` leads from `state`.

    Raises
    ------
    IllegalEvent : the table holds no such transition.
    """
    try:
        return TRANSITIONS[state][type(event)]
    except KeyError:
        raise IllegalEvent(f"{type(event).__name__} in state {state}") from None
