from typing import get_args

import pytest

from mpucal.data import Sensor
from mpucal.session.events import Abort, Connected, Event, Fitted
from mpucal.session.machine import Machine
from mpucal.session.table import TRANSITIONS, IllegalEvent, State, next_state

# The table looks at the class of an event alone.
EVENTS = {kind.__name__: object.__new__(kind) for kind in get_args(Event)}

# Written by hand: the state to which each event leads, "" where it is illegal.
EXPECTED = {
    #              connect     lay flat    rotate       verify       calibrate    write
    "Connected": ("lay flat", "", "", "", "", ""),
    "Measured": ("", "lay flat", "rotate", "verify", "", ""),
    "Tick": ("", "lay flat", "rotate", "verify", "", ""),
    "Enough": ("connect", "lay flat", "rotate", "verify", "calibrate", "write"),
    "Redo": ("connect", "lay flat", "rotate", "rotate", "calibrate", "write"),
    "Abort": ("aborted", "aborted", "aborted", "aborted", "aborted", "aborted"),
    "Resumed": ("", "lay flat", "rotate", "verify", "", "", "", "lay flat"),
    "Learnt": ("", "", "rotate", "verify", "", ""),
    "Tried": ("", "", "", "verify", "", ""),
    "Checked": ("", "", "", "verify", "", ""),
    "SourceEnded": ("aborted", "aborted", "calibrate", "calibrate", "", ""),
    "Fitted": ("", "", "", "", "write", ""),
    "Written": ("", "", "", "", "", "done"),
    "Rested": ("", "rotate", "", "", "", ""),
    "Turned": ("", "", "verify", "", "", ""),
    "Finished": ("", "", "calibrate", "calibrate", "", ""),
    "Stopped": ("", "aborted", "", "", "", ""),
}


@pytest.mark.parametrize("name", EXPECTED)
def test_each_event_leads_to_its_state(name):
    row = EXPECTED[name]
    for state, following in zip(State, (*row, *[""] * (len(State) - len(row))), strict=True):
        if following:
            assert next_state(state, EVENTS[name]) == following, state
        else:
            with pytest.raises(IllegalEvent, match=f"{name} in state {state}"):
                next_state(state, EVENTS[name])


def test_every_event_is_in_a_row():
    assert {event.__name__ for row in TRANSITIONS.values() for event in row} == set(EVENTS) == set(EXPECTED)


def test_an_illegal_event_changes_no_state():
    machine = Machine()
    with pytest.raises(IllegalEvent):
        machine.handle(Fitted("good"))
    assert machine.state is State.CONNECT
    machine.handle(Connected(Sensor()))
    assert machine.state is State.LAY_FLAT


def test_every_state_but_the_last_two_can_be_aborted():
    assert [state for state in State if Abort not in TRANSITIONS[state]] == [State.DONE, State.ABORTED]
