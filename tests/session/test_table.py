import pytest

from mpucal.data import Samples, Sensor
from mpucal.session.events import (
    Abort,
    Checked,
    Connected,
    Enough,
    Finished,
    Fitted,
    Knowledge,
    Learnt,
    Measured,
    Redo,
    Rested,
    Resumed,
    SourceEnded,
    Stopped,
    Target,
    Tick,
    Tried,
    Turned,
    Written,
)
from mpucal.session.machine import Machine
from mpucal.session.table import TRANSITIONS, IllegalEvent, State, next_state

ONE = (1.0, 1.0, 1.0)
EVENTS = {
    "Connected": Connected(Sensor()),
    "Measured": Measured(Samples.empty()),
    "Tick": Tick(0.0),
    "Enough": Enough(),
    "Redo": Redo(),
    "Abort": Abort(),
    "Resumed": Resumed(3.0),
    "Learnt": Learnt(Knowledge(0.0, ONE, ONE, ONE, Target(0.1, 0.05, 1.0), ONE, ONE, ONE, 1.0, None, ""), advice=True),
    "Tried": Tried("good"),
    "Checked": Checked((), agrees=True),
    "SourceEnded": SourceEnded(),
    "Fitted": Fitted("good"),
    "Written": Written(()),
    "Rested": Rested(10.0, (0.0, 0.0, 9.8), (0.0, 0.0, 0.0)),
    "Turned": Turned("enough"),
    "Finished": Finished("verified"),
    "Stopped": Stopped("it moved", "start again"),
}

# written out by hand: where each event leads, "" where it may not happen
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
CASES = [
    pytest.param(state, EVENTS[name], following, id=f"{state}-{name}")
    for name, row in EXPECTED.items()
    for state, following in zip(State, (*row, *[""] * (len(State) - len(row))), strict=True)
]


@pytest.mark.parametrize(("state", "event", "following"), CASES)
def test_leads_where_it_should(state, event, following):
    if following:
        assert next_state(state, event) == following
    else:
        with pytest.raises(IllegalEvent, match=f"{type(event).__name__} in state {state}"):
            next_state(state, event)


def test_every_event_is_in_a_row():
    assert {event.__name__ for row in TRANSITIONS.values() for event in row} == set(EVENTS)


def test_an_illegal_event_leaves_the_machine_as_it_was():
    machine = Machine()
    with pytest.raises(IllegalEvent):
        machine.handle(Fitted("good"))
    assert machine.state is State.CONNECT
    machine.handle(Connected(Sensor()))
    assert machine.state is State.LAY_FLAT


def test_every_state_but_the_last_two_can_be_aborted():
    assert [state for state in State if Abort not in TRANSITIONS[state]] == [State.DONE, State.ABORTED]
