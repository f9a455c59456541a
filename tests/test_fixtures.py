"""Files of fixtures/: complete, small, and equal to what the tool makes."""

import json
from pathlib import Path

import numpy as np
import pytest

from mpucal.chip.driver import DRIVER_VERSION
from mpucal.files.mcap import read_capture
from tools.make import fixtures

PROJECT = Path(__file__).parents[1]
FIXTURES = PROJECT / "fixtures"
CAPTURES = sorted(FIXTURES.glob("sessions/*.mcap"))
MADE = "enter"


@pytest.mark.parametrize("capture", CAPTURES, ids=lambda path: path.stem)
def test_a_capture_is_small_whole_and_of_this_driver(capture):
    assert capture.stat().st_size < 300_000
    read = read_capture(capture)
    assert read.recovered is None
    assert read.meta["driver"] == DRIVER_VERSION


@pytest.mark.slow
def test_the_tool_makes_the_stored_fixtures(monkeypatch, tmp_path):
    """Make one of the sessions, in which keys are pressed; all are replayed in test_session_replay.py."""
    monkeypatch.setattr(fixtures, "SESSIONS", {MADE: fixtures.SESSIONS[MADE]})
    fixtures.main(tmp_path)
    made = sorted(path.relative_to(tmp_path) for path in tmp_path.glob("*/*"))
    stored = (path.relative_to(FIXTURES) for path in FIXTURES.glob("*/*"))
    assert made == sorted(path for path in stored if path.parent.name != "sessions" or path.stem == MADE)
    for path in made:
        # the vectors have a test of their own
        if path.parent.name != "vectors" and path.suffix == ".json":
            # another machine's sines may move a count by one
            new, old = (json.loads((folder / path).read_text()) for folder in (tmp_path, FIXTURES))
            if path.parent.name == "faults":
                rates = new.pop("rate_hz"), old.pop("rate_hz")
                assert new == old
                assert rates[0] == pytest.approx(rates[1], rel=1e-6)
                continue
            assert new["said"] == old["said"]
            np.testing.assert_allclose(new["D"], old["D"], atol=1e-4)
