import subprocess
import sys
from pathlib import Path

import pytest

from mpucal.data import Samples, Sensor
from mpucal.session.events import (
    Abort,
    Connected,
    Enough,
    Fitted,
    Measured,
    Rested,
    SourceEnded,
    Stopped,
    Tick,
    Turned,
    Written,
)
from mpucal.session.machine import Machine
from mpucal.session.table import TRANSITIONS, IllegalEvent, State, next_state

EVENTS = {
    "Connected": Connected(Sensor()),
    "Measured": Measured(Samples.empty()),
    "Tick": Tick(0.0),
    "Enough": Enough(),
    "Abort": Abort(),
    "SourceEnded": SourceEnded(),
    "Fitted": Fitted("good"),
    "Written": Written(()),
    "Rested": Rested(10.0, (0.0, 0.0, 9.8)),
    "Turned": Turned("enough"),
    "Stopped": Stopped("it moved", "start again"),
}

# written out by hand: where each event leads, "" where it may not happen
EXPECTED = {
    #              connect     lay flat    rotate       calibrate    write
    "Connected": ("lay flat", "", "", "", ""),
    "Measured": ("", "lay flat", "rotate", "", ""),
    "Tick": ("", "lay flat", "rotate", "", ""),
    "Enough": ("connect", "lay flat", "calibrate", "calibrate", "write"),
    "Abort": ("aborted", "aborted", "aborted", "aborted", "aborted"),
    "SourceEnded": ("aborted", "aborted", "calibrate", "", ""),
    "Fitted": ("", "", "", "write", ""),
    "Written": ("", "", "", "", "done"),
    "Rested": ("", "rotate", "", "", ""),
    "Turned": ("", "", "calibrate", "", ""),
    "Stopped": ("", "aborted", "", "", ""),
}
CASES = [
    pytest.param(state, EVENTS[name], following, id=f"{state}-{name}")
    for name, row in EXPECTED.items()
    for state, following in zip(State, (*row, "", ""), strict=True)
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


def test_the_documented_diagram_is_drawn_from_the_table():
    tool = Path(__file__).parents[2] / "tools" / "draw_session.py"
    checked = subprocess.run([sys.executable, tool, "--check"], capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stderr
