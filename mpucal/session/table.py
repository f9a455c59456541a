"""The transition table of a session: which event leads from which state to which."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum

from . import events


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
_KEYS = (events.Enough, events.Redo)
_SAMPLES = (events.Measured, events.Tick, events.Resumed, events.Enough)
TAKEN: Mapping[State, tuple[type[events.Event], ...]] = {
    State.CONNECT: _KEYS,
    State.LAY_FLAT: (*_SAMPLES, events.Redo),
    State.ROTATE: (*_SAMPLES, events.Learnt),
    State.VERIFY: (*_SAMPLES, events.Learnt, events.Tried, events.Checked),
    State.CALIBRATE: _KEYS,
    State.WRITE: _KEYS,
}
# Events that begin a state, which may be the present one. An event that neither table names is illegal in that state.
TRANSITIONS: Mapping[State, Mapping[type[events.Event], State]] = {
    State.CONNECT: {
        events.Connected: State.LAY_FLAT,
        events.SourceEnded: State.ABORTED,
        events.Abort: State.ABORTED,
    },
    State.LAY_FLAT: {
        events.Rested: State.ROTATE,
        events.Stopped: State.ABORTED,
        events.SourceEnded: State.ABORTED,
        events.Abort: State.ABORTED,
    },
    State.ROTATE: {
        events.Redo: State.ROTATE,
        events.Turned: State.VERIFY,
        events.Finished: State.CALIBRATE,
        events.SourceEnded: State.CALIBRATE,
        events.Abort: State.ABORTED,
    },
    State.VERIFY: {
        events.Redo: State.ROTATE,
        events.Finished: State.CALIBRATE,
        events.SourceEnded: State.CALIBRATE,
        events.Abort: State.ABORTED,
    },
    State.CALIBRATE: {events.Fitted: State.WRITE, events.Abort: State.ABORTED},
    State.WRITE: {events.Written: State.DONE, events.Abort: State.ABORTED},
    State.DONE: {},
    # Resumed after a board that was never still, for example: there is no flat rest yet.
    State.ABORTED: {events.Resumed: State.LAY_FLAT},
}


class IllegalEvent(Exception):  # noqa: N818 - named by what went wrong
    """Event that is not legal in the machine's state: a programming error of its owner."""


def next_state(state: State, event: events.Event) -> tuple[State, bool]:
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
