"""Live and offline find the same rests, in some of the recordings of which the program takes hundreds."""

import numpy as np
import pytest

from mpucal.data import Recording
from tools.lab import rests
from tools.lab.table import Row


@pytest.mark.parametrize("kind", ["poses trembling", "six poses", "phone poses", "two decimals"])
def test_the_session_and_the_recording_have_the_same_rests(kind):
    found = rests.of_seed((kind, 100))
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
