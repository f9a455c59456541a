"""Sessions on a chip that suffers faults end in a true calibration or a true refusal, and never in a trace."""

import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from mpucal.simulated.faults import OF_CHIP, Fault, kinds
from tools.lab import fault_sessions

KINDS = kinds(*OF_CHIP)
LONGEST_S = 60

once = settings(max_examples=1, deadline=None, suppress_health_check=list(HealthCheck))
thrice = settings(once, max_examples=3)
names_of = st.sampled_from(sorted(KINDS))


def moments(end_s):
    return st.integers(0, 100 * end_s).map(lambda t: t / 100)


@once
@given(
    names=st.tuples(names_of, names_of), at_s=st.tuples(moments(LONGEST_S), moments(LONGEST_S)), seed=st.integers(0, 30)
)
def test_no_session_calls_a_wrong_calibration_good(names, at_s, seed):
    assume(any(at_s))  # what hypothesis begins with is the same every time
    faults = tuple(map(Fault, names, at_s))
    ended = fault_sessions.outcome(faults, seed, model="accel")
    assert not ended.wrong, ended
    assert ended.code == 0 or ended.said


@pytest.mark.parametrize("name", KINDS)
@thrice
@given(data=st.data(), other=names_of, seed=st.integers(0, 1000))
def test_no_pair_of_faults_makes_a_wrong_calibration_good(name, data, other, seed):
    """A recording calibrated afterwards: as a session, without the fits behind its advice."""
    names = (name, other)
    at_s = [data.draw(moments(fault_sessions.RECORDED_S), label) for label in names]
    assume(any(at_s))
    faults = tuple(map(Fault, names, at_s))
    ended = fault_sessions.recorded(faults, seed)
    assert not ended.wrong, (faults, seed, ended)
    assert ended.code != 3 or ended.said
