"""The transition table of a session: which event leads from which state to which."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from types import MappingProxyType

from .events import (
    Abort,
    Checked,
    Connected,
    Enough,
    Event,
    Finished,
    Fitted,
    Learnt,
    Measured,
    Redo,
    Rested,
    Resumed,
    SourceEnded,
    Stopped,
    Tick,
    Tried,
    Turned,
    Written,
)


class State(StrEnum):
    """States of a session."""

    CONNECT = "connect"
    LAY_FLAT = "lay flat"
    ROTATE = "rotate"
    VERIFY = "verify"
    CALIBRATE = "calibrate"
    WRITE = "write"
    DONE = "done"
    ABORTED = "aborted"


def _stay(state: State, *events: type[Event]) -> dict[type[Event], State]:
    """Return the rows of events that leave the session in `state`."""
    return dict.fromkeys(events, state)


# States that need samples.
MEASURING = (State.LAY_FLAT, State.ROTATE, State.VERIFY)
# An event that a row does not name is illegal in that state.
TRANSITIONS: Mapping[State, Mapping[type[Event], State]] = MappingProxyType(
    {
        State.CONNECT: {
            **_stay(State.CONNECT, Enough, Redo),
            Connected: State.LAY_FLAT,
            SourceEnded: State.ABORTED,
            Abort: State.ABORTED,
        },
        State.LAY_FLAT: {
            **_stay(State.LAY_FLAT, Measured, Tick, Resumed, Enough, Redo),
            Rested: State.ROTATE,
            Stopped: State.ABORTED,
            SourceEnded: State.ABORTED,
            Abort: State.ABORTED,
        },
        State.ROTATE: {
            **_stay(State.ROTATE, Measured, Tick, Learnt, Resumed, Enough, Redo),
            Turned: State.VERIFY,
            Finished: State.CALIBRATE,
            SourceEnded: State.CALIBRATE,
            Abort: State.ABORTED,
        },
        State.VERIFY: {
            **_stay(State.VERIFY, Measured, Tick, Learnt, Tried, Checked, Resumed, Enough),
            Redo: State.ROTATE,
            Finished: State.CALIBRATE,
            SourceEnded: State.CALIBRATE,
            Abort: State.ABORTED,
        },
        State.CALIBRATE: {
            **_stay(State.CALIBRATE, Enough, Redo),
            Fitted: State.WRITE,
            Abort: State.ABORTED,
        },
        State.WRITE: {
            **_stay(State.WRITE, Enough, Redo),
            Written: State.DONE,
            Abort: State.ABORTED,
        },
        State.DONE: {},
        # Resumed after a board that was never still, for example: there is no flat rest yet.
        State.ABORTED: {Resumed: State.LAY_FLAT},
    }
)


class IllegalEvent(Exception):  # noqa: N818 - named by what went wrong
    """Event that is not legal in the machine's state: a programming error of its owner."""


def next_state(state: State, event: Event) -> State:
    """Return the state to which `event` leads from `state`.

    Raises
    ------
    IllegalEvent : the table holds no such transition.
    """
    try:
        return TRANSITIONS[state][type(event)]
    except KeyError:
        raise IllegalEvent(f"{type(event).__name__} in state {state}") from None
