import pytest

from mpucal.data import Sensor
from mpucal.session.events import Abort, Connected, Fitted
from mpucal.session.machine import Machine
from mpucal.session.table import TRANSITIONS, IllegalEvent, State


def test_an_illegal_event_changes_no_state():
    machine = Machine()
    with pytest.raises(IllegalEvent):
        machine.handle(Fitted("good"))
    assert machine.state is State.CONNECT
    machine.handle(Connected(Sensor()))
    assert machine.state is State.LAY_FLAT


def test_every_state_but_the_last_two_can_be_aborted():
    assert [state for state in State if Abort not in TRANSITIONS[state]] == [State.DONE, State.ABORTED]
