"""Table of the model's parameters, and the layouts in Python and in the kernel that follow from it."""

from dataclasses import fields

import numpy as np
import pytest

from mpucal.calibration import parameters
from mpucal.calibration.parameters import LANES, MODELS, NAMES, PLACES, TABLE, estimated, lanes_used
from mpucal.calibration.theta import Theta


def test_the_parameters_of_a_model_come_first():
    stages = [MODELS.index(row.model) for row in TABLE]
    assert stages == sorted(stages)
    assert [row.name for row in estimated("hand")] == [row.name for row in TABLE]


def test_every_parameter_has_a_name_a_place_and_a_lane_of_its_own():
    assert len(set(NAMES)) == len(NAMES) == len(LANES) == len(set(LANES))
    assert [i for row in TABLE for i in range(*PLACES[row.name].indices(len(NAMES)))] == list(range(len(NAMES)))
    assert all(len(row.sd) in (0, len(row.names)) for row in TABLE)


def test_a_model_uses_only_the_lanes_of_its_parameters():
    for model in MODELS:
        beyond = {lane for row in TABLE if row not in estimated(model) for lane in row.lanes}
        assert not beyond & set(range(lanes_used(model)))


def test_theta_holds_the_rows():
    assert {field.name for field in fields(Theta)} == {row.field for row in TABLE}


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


def test_the_start_is_a_perfect_sensor_at_rest():
    u = np.array([0.0, 0.6, 0.8])
    theta = Theta.start(np.eye(3), np.zeros(3), np.zeros(3), u)
    assert theta.values().tolist() == [mean for row in TABLE for mean in row.mean]
    np.testing.assert_array_equal(theta.K, np.eye(3))


def test_a_kernel_of_another_table_is_refused(monkeypatch):
    import importlib

    from mpucal.calibration import likelihood

    monkeypatch.setattr(parameters, "LAYOUT", "another")
    with pytest.raises(ImportError, match="build it again"):
        importlib.reload(likelihood)
