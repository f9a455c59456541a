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
    """Where a session is."""

    CONNECT = "connect"
    LAY_FLAT = "lay flat"
    ROTATE = "rotate"
    VERIFY = "verify"
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
            Redo: State.CONNECT,
            SourceEnded: State.ABORTED,
            Abort: State.ABORTED,
        },
        State.LAY_FLAT: {
            Measured: State.LAY_FLAT,
            Tick: State.LAY_FLAT,
            Resumed: State.LAY_FLAT,
            Enough: State.LAY_FLAT,
            Redo: State.LAY_FLAT,
            Rested: State.ROTATE,
            Stopped: State.ABORTED,
            SourceEnded: State.ABORTED,
            Abort: State.ABORTED,
        },
        State.ROTATE: {
            Measured: State.ROTATE,
            Tick: State.ROTATE,
            Learnt: State.ROTATE,
            Resumed: State.ROTATE,
            Enough: State.ROTATE,
            Redo: State.ROTATE,
            Turned: State.VERIFY,
            Finished: State.CALIBRATE,
            SourceEnded: State.CALIBRATE,
            Abort: State.ABORTED,
        },
        State.VERIFY: {
            Measured: State.VERIFY,
            Tick: State.VERIFY,
            Learnt: State.VERIFY,
            Tried: State.VERIFY,
            Checked: State.VERIFY,
            Resumed: State.VERIFY,
            Enough: State.VERIFY,
            Redo: State.ROTATE,
            Finished: State.CALIBRATE,
            SourceEnded: State.CALIBRATE,
            Abort: State.ABORTED,
        },
        State.CALIBRATE: {
            Fitted: State.WRITE,
            Enough: State.CALIBRATE,
            Redo: State.CALIBRATE,
            Abort: State.ABORTED,
        },
        State.WRITE: {
            Written: State.DONE,
            Enough: State.WRITE,
            Redo: State.WRITE,
            Abort: State.ABORTED,
        },
        State.DONE: {},
        # by a board that was never still, say: there is no flat rest yet
        State.ABORTED: {Resumed: State.LAY_FLAT},
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
