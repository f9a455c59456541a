"""Table of the model's parameters, and the layouts in Python and in the kernel that follow from it."""

import numpy as np
import pytest

from mpucal.calibration import parameters
from mpucal.calibration.parameters import NAMES, PLACES, TABLE
from mpucal.calibration.theta import Theta


@pytest.mark.parametrize("row", TABLE, ids=lambda row: row.name)
def test_a_step_changes_its_own_parameter_alone(row):
    rng = np.random.default_rng(1)
    theta = Theta.start(rng.normal(size=(3, 3)), rng.normal(size=3), rng.normal(size=3), np.array([0.0, 0.6, 0.8]))
    step = np.zeros(len(NAMES))
    step[PLACES[row.name]] = np.linspace(0.01, 0.02, len(row.names))
    moved = theta.moved(step)
    changed = [name for name in vars(theta) if not np.array_equal(getattr(theta, name), getattr(moved, name))]
    assert changed == [row.field]
    # The tilts are measured from the direction itself.
    expected = step if row.name != "tilt" else 0.0 * step
    np.testing.assert_allclose(moved.values() - theta.values(), expected, atol=1e-15)


def test_a_kernel_of_another_table_is_refused(monkeypatch):
    import importlib

    from mpucal.calibration import likelihood

    monkeypatch.setattr(parameters, "LAYOUT", "another")
    with pytest.raises(ImportError, match="build it again"):
        importlib.reload(likelihood)
