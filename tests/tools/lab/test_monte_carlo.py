import numpy as np
import pytest

from tools.lab import monte_carlo
from tools.lab.judge import judgement
from tools.lab.table import Row


def run(error, failure=None):
    row = judgement("good", error=error, z=(1.0,) * 12, scene="12 poses", model="hand", failure=failure)
    row.method = "mpucal"
    return row


def column(name, *runs):
    return monte_carlo.COLUMNS[name](runs)


def test_a_failure_is_named_and_not_among_the_successful():
    runs = run(0.1), run(0.3), run(8.0, "not converged")
    assert column("error, m/s²", *runs) == pytest.approx(0.2)
    assert column("worst error", *runs) == 0.3
    assert column("models, failures", *runs) == "hand 2, not converged 1"


def test_a_simulated_sensor_is_found_as_well_as_is_claimed():
    found = monte_carlo.of_seed(("paper", 0, "mpucal"), "auto")
    assert found.failure is None and found.model == "accel" and found.known_K == 0
    assert found.error < 0.1 < found.before
    assert found.rms_z < 2.0
    uncalibrated, true, calibrated = found.roll_deg
    assert true < calibrated < uncalibrated


def test_an_efficient_estimator_has_a_ratio_of_one():
    sd = np.linspace(0.1, 0.5, 12)
    rng = np.random.default_rng(0)
    covariance = np.diag(sd**2)

    fits = [Row(covariance=covariance, errors=sd * rng.standard_normal(12)) for _ in range(2000)]
    found = monte_carlo.efficiency(fits)
    assert [row["RMSE / √CRLB"] for row in found] == pytest.approx([1.0] * 12, abs=0.06)


def test_ours_beats_the_ellipsoid_and_that_no_calibration():
    ours, ellipsoid = (
        monte_carlo.of_seed(("12 poses", 1, method), "auto") for method in ("mpucal", "ellipsoid, turned to the gyro")
    )
    assert ours.error < ellipsoid.error < ours.before
