"""Which sinks a session writes to."""

import pytest

from mpucal.errors import UsageError
from mpucal.sinks.choose import announced, chosen


@pytest.mark.parametrize(
    ("asked", "no_write", "source", "names"),
    [
        ((), False, "bus", []),
        ((), False, "serial", ["bridge"]),
        ((), False, "mavlink", ["autopilot"]),
        ((), False, "replay", []),
        ((), True, "mavlink", []),
        (("file",), False, "serial", []),
        (("chip",), False, "bus", ["chip"]),
        (("bridge", "chip"), False, "serial", ["chip", "bridge"]),
    ],
)
def test_a_session_chooses_the_sink_that_fits_its_source(asked, no_write, source, names):
    kinds = chosen(asked, no_write, source)
    assert [kind.name for kind in kinds] == names
    said = announced(kinds, no_write)
    assert said.startswith("The result goes to files")
    assert all(kind.where in said for kind in kinds)


@pytest.mark.parametrize(
    ("asked", "no_write", "source", "says"),
    [
        (("chip",), True, "bus", "leave one of them out"),
        (("bridge",), False, "bus", "--bus has no bridge: give --serial, or leave it out"),
        (("autopilot",), False, "bus", "give --mavlink"),
        (("chip",), False, "mavlink", "--mavlink has no chip: give --bus or --serial"),
        (("chip",), False, "replay", "--replay has no sensor to write to"),
    ],
)
def test_a_sink_that_is_not_there_is_wrong_usage_before_anything_begins(asked, no_write, source, says):
    with pytest.raises(UsageError, match=says):
        chosen(asked, no_write, source)
