"""Choice of the sinks of a session."""

import re

import pytest

from mpucal.errors import UsageError
from mpucal.sinks.choose import announce_sinks, choose_sinks
from mpucal.sources.table import matching_kinds


def source(name):
    return matching_kinds({name: "x"})[0]


@pytest.mark.parametrize(
    ("asked", "no_write", "name", "names"),
    [
        ((), False, "bus", []),
        ((), False, "mavlink", ["autopilot"]),
        ((), True, "mavlink", []),
        (("file",), False, "serial", []),
        (("bridge", "chip"), False, "serial", ["chip", "bridge"]),
    ],
)
def test_a_session_chooses_the_sink_that_fits_its_source(asked, no_write, name, names):
    kinds = choose_sinks(asked, no_write, source(name))
    assert [kind.name for kind in kinds] == names
    said = announce_sinks(kinds, no_write)
    assert said.startswith("Results are written to files")
    assert all(kind.where in said for kind in kinds)


@pytest.mark.parametrize(
    ("asked", "no_write", "name", "says"),
    [
        (("chip",), True, "bus", "leave one of them out"),
        (("bridge",), False, "bus", "--bus has no bridge: give --serial PORT[:BAUD], or leave it out"),
        (("chip",), False, "mavlink", "--mavlink has no chip: give exactly one of --bus BUS"),
        (("chip",), False, "replay", "--replay has no sensor to write to"),
    ],
)
def test_a_sink_that_is_not_there_is_wrong_usage_before_anything_begins(asked, no_write, name, says):
    with pytest.raises(UsageError, match=re.escape(says)):
        choose_sinks(asked, no_write, source(name))
