"""Series, parameters and constants without neutral values, and the builds of the kernel."""

import numpy as np
import pytest

from mpucal.calibration.parameters import NAMES
from mpucal.calibration.problem import Series
from mpucal.calibration.theta import Theta
from mpucal.kernel import _kernel
from mpucal.rests.flat import Flat

N = 140


@pytest.fixture(scope="session")
def hand_series():
    rng = np.random.default_rng(5)
    reset = np.full(N, -1.0)
    reset[[50, 80]] = 0.1, 0.0
    dt = rng.uniform(0.004, 0.02, N)
    dt[100:120] = 0.01  # equal steps, which the filter may compute once
    dt[130] = 0.7  # a gap
    return Series(
        y=rng.normal([1.0, -2.0, 9.3], 0.4, (N, 3)),
        omega=rng.normal(0.2, 1.0, (N, 3)),
        dt=dt,
        r_scale=rng.uniform(0.5, 3.0, N),
        q_scale=rng.uniform(0.5, 3.0, N),
        q_extra=rng.uniform(0.0, 1e-5, N),
        rate=rng.normal(0.0, 1.0, (N, 3)),
        alpha=rng.normal(0.0, 3.0, (N, 3)),
        r_extra=rng.uniform(0.0, 0.05, N),
        jerk=rng.uniform(0.0, 10.0, N),
        reset=reset,
    )


@pytest.fixture(scope="session")
def theta():
    rng = np.random.default_rng(6)
    start = Theta.start(np.eye(3), np.zeros(3), np.zeros(3), np.array([0.1, -0.2, np.sqrt(0.95)]))
    return start.moved(rng.normal(0.0, 0.05, len(NAMES)))


@pytest.fixture(scope="session")
def flat():
    return Flat(
        0,
        1000,
        y=np.array([0.9, -2.1, 9.2]),
        b_omega=np.full(3, 0.1),
        Sigma_a=np.array([0.01, 0.02, 0.03]),
        Sigma_omega=np.array([1e-3, 2e-3, 3e-3]),
    )


@pytest.fixture(params=["best", "portable"])
def instruction_set(request):
    _kernel.use_instruction_set(request.param)
    yield request.param
    _kernel.use_instruction_set("best")
