import pytest

from tools.lab import watch_trials as trials


@pytest.mark.slow
def test_a_right_calibration_is_not_warned_of_and_a_wrong_one_is():
    """A few minutes of use, of which the campaign simulates hours."""
    unchanged = trials.of_use(("nothing", 4), hours=0.03)
    assert unchanged.told == []
    changed = trials.of_use(("bias 20 mg", 4), hours=0.03)
    assert changed.told[0][0] == "accelerometer"
    assert changed.told[0][1] < 150.0
    told, last = (trials.COLUMNS[name]([changed]) for name in ("told", "last"))
    assert told == 1
    assert float(last) == pytest.approx(changed.told[0][1] / 60.0, abs=0.05)
    assert trials.COLUMNS["last"]([unchanged]) == ""
