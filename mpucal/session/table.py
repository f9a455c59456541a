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


# States that need samples.
MEASURING = (State.LAY_FLAT, State.ROTATE, State.VERIFY)
# Events that a state takes and that leave it as it is.
_KEYS = (Enough, Redo)
_SAMPLES = (Measured, Tick, Resumed, Enough)
TAKEN: Mapping[State, tuple[type[Event], ...]] = MappingProxyType(
    {
        State.CONNECT: _KEYS,
        State.LAY_FLAT: (*_SAMPLES, Redo),
        State.ROTATE: (*_SAMPLES, Learnt),
        State.VERIFY: (*_SAMPLES, Learnt, Tried, Checked),
        State.CALIBRATE: _KEYS,
        State.WRITE: _KEYS,
    }
)
# Events that begin a state, which may be the present one. An event that neither table names is illegal in that state.
TRANSITIONS: Mapping[State, Mapping[type[Event], State]] = MappingProxyType(
    {
        State.CONNECT: {Connected: State.LAY_FLAT, SourceEnded: State.ABORTED, Abort: State.ABORTED},
        State.LAY_FLAT: {
            Rested: State.ROTATE,
            Stopped: State.ABORTED,
            SourceEnded: State.ABORTED,
            Abort: State.ABORTED,
        },
        State.ROTATE: {
            Redo: State.ROTATE,
            Turned: State.VERIFY,
            Finished: State.CALIBRATE,
            SourceEnded: State.CALIBRATE,
            Abort: State.ABORTED,
        },
        State.VERIFY: {
            Redo: State.ROTATE,
            Finished: State.CALIBRATE,
            SourceEnded: State.CALIBRATE,
            Abort: State.ABORTED,
        },
        State.CALIBRATE: {Fitted: State.WRITE, Abort: State.ABORTED},
        State.WRITE: {Written: State.DONE, Abort: State.ABORTED},
        State.DONE: {},
        # Resumed after a board that was never still, for example: there is no flat rest yet.
        State.ABORTED: {Resumed: State.LAY_FLAT},
    }
)


class IllegalEvent(Exception):  # noqa: N818 - named by what went wrong
    """Event that is not legal in the machine's state: a programming error of its owner."""


def next_state(state: State, event: Event) -> tuple[State, bool]:
    """Return the state after an event, and True if the event begins it.

    Raises
    ------
    IllegalEvent : the tables do not name the event in this state.
    """
    if (begun := TRANSITIONS[state].get(type(event))) is not None:
        return begun, True
    if type(event) in TAKEN.get(state, ()):
        return state, False
    raise IllegalEvent(f"{type(event).__name__} in state {state}")
