import io

import numpy as np
import pytest
from rich.console import Console

from mpucal.simulated.study.scenarios import hand_scenario


@pytest.fixture
def changes(tool):
    return tool("changes")


@pytest.fixture(scope="module")
def recording():
    return hand_scenario(0, "continuous", rate_hz=50.0).recording


@pytest.mark.parametrize("change", [("mount", 4.0), ("accelerometer", 0.5), ("gyroscope", 3.0)], ids=lambda c: c[0])
def test_a_change_begins_where_it_should_and_is_as_large(changes, recording, change):
    other = changes.changed(recording, change, 0)
    at = int(changes.CHANGED_AT * len(recording))
    np.testing.assert_array_equal(other.acc[:at], recording.acc[:at])
    np.testing.assert_array_equal(other.gyr[:at], recording.gyr[:at])
    what, size = change
    if what == "mount":
        np.testing.assert_allclose(np.linalg.norm(other.acc, axis=1), np.linalg.norm(recording.acc, axis=1))
        cosine = np.sum(other.acc[at:] * recording.acc[at:], axis=1) / np.sum(recording.acc[at:] ** 2, axis=1)
        assert np.degrees(np.arccos(cosine.min())) == pytest.approx(size, rel=0.1)
    else:
        step = other.acc[at:] - recording.acc[at:] if what == "accelerometer" else other.gyr[at:] - recording.gyr[at:]
        expected = size if what == "accelerometer" else np.radians(size)
        np.testing.assert_allclose(np.linalg.norm(step, axis=1), expected)


def test_a_change_is_noticed_and_none_is_not(changes):
    clean, slipped = (
        changes.judged(("continuous", change, 1), "auto") for change in (("nothing", 0.0), ("mount", 6.0))
    )
    assert clean.verdict == "good"
    assert not clean.false
    assert "inconsistent" in slipped.codes
    stream = io.StringIO()
    Console(file=stream, width=150).print(changes.table("changes", [clean, slipped]))
    assert "mount, 6 deg" in stream.getvalue()
    assert "nothing" in stream.getvalue()
