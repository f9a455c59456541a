"""Live and offline find the same rests, in a dozen of the recordings of which the program takes hundreds."""

import numpy as np
import pytest

from mpucal.data import Recording
from tools.lab import rests
from tools.lab.table import Row

KINDS = ("poses", "poses trembling", "poses of a session", "six poses", "phone poses", "two decimals")


@pytest.mark.parametrize("seed", [100, 101])
@pytest.mark.parametrize("kind", KINDS)
def test_the_session_and_the_recording_have_the_same_rests(kind, seed):
    found = rests.of_seed((kind, seed))
    assert found.held >= 5
    assert found.agrees, found


def test_a_recording_that_never_lies_flat_is_not_compared():
    noise = np.random.default_rng(0).standard_normal((2000, 6))
    shaken = Recording.from_arrays(np.arange(2000) / 100.0, 5.0 * noise[:, :3], noise[:, 3:])
    assert not rests.of_recording(shaken, "shaken", 0).flat


def test_the_program_counts_and_lists(capsys):
    differs = Row(name="lift", seed=1, flat=True, held=3, rests=2, only_held=[(1.0, 2.5)], only_rests=[], agrees=False)
    found = [Row(flat=True, agrees=True), differs, Row(flat=False)]
    assert rests.report(found, least=0.6) == 1
    said = capsys.readouterr().out
    assert "lift" in said
    assert "1 of 2 agree; 1 more have no flat segment" in said
