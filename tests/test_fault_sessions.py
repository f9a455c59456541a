"""Whole sessions on a chip that suffers faults end in a true calibration or a true refusal, and never in a trace."""

import sys
from importlib import import_module
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mpucal.bus.simulated.faults import KINDS, Fault

TOOLS = Path(__file__).parents[1] / "tools"


@pytest.fixture(scope="module")
def outcome():
    sys.path.insert(0, str(TOOLS))
    yield import_module("fault_sessions").outcome
    sys.path.remove(str(TOOLS))


@settings(max_examples=2, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    faults=st.lists(
        st.builds(Fault, st.sampled_from(sorted(KINDS)), st.floats(0, 60).map(lambda t: round(t, 2))),
        min_size=1,
        max_size=2,
    ),
    seed=st.integers(0, 30),
)
def test_no_wrong_calibration_is_called_good(outcome, faults, seed):
    ended = outcome(faults, seed, model="accel")
    assert not ended.wrong, ended
    assert ended.code == 0 or ended.said
