"""Made by tools/make/stubs.py from the compiled module; its functions say what they do."""

import numpy
from numpy.typing import NDArray

layout: str = ...

def evaluate(
    theta: NDArray[numpy.float64],
    constants: NDArray[numpy.float64],
    lanes: int,
    y: NDArray[numpy.float64],
    omega: NDArray[numpy.float64],
    dt: NDArray[numpy.float64],
    r_scale: NDArray[numpy.float64] | None = None,
    q_scale: NDArray[numpy.float64] | None = None,
    q_extra: NDArray[numpy.float64] | None = None,
    ends: NDArray[numpy.int64] | None = None,
) -> tuple[float, float, NDArray[numpy.float64], NDArray[numpy.float64]]: ...
def evaluate_hand(
    theta: NDArray[numpy.float64],
    constants: NDArray[numpy.float64],
    derivatives: bool,
    y: NDArray[numpy.float64],
    omega: NDArray[numpy.float64],
    dt: NDArray[numpy.float64],
    r_scale: NDArray[numpy.float64] | None = None,
    q_scale: NDArray[numpy.float64] | None = None,
    q_extra: NDArray[numpy.float64] | None = None,
    rate: NDArray[numpy.float64] | None = None,
    alpha: NDArray[numpy.float64] | None = None,
    r_extra: NDArray[numpy.float64] | None = None,
    jerk: NDArray[numpy.float64] | None = None,
    reset: NDArray[numpy.float64] | None = None,
    force: NDArray[numpy.float64] | None = None,
    ends: NDArray[numpy.int64] | None = None,
) -> tuple[float, float, NDArray[numpy.float64], NDArray[numpy.float64]]: ...
def trace_hand(
    theta: NDArray[numpy.float64],
    constants: NDArray[numpy.float64],
    y: NDArray[numpy.float64],
    omega: NDArray[numpy.float64],
    dt: NDArray[numpy.float64],
    r_scale: NDArray[numpy.float64] | None = None,
    q_scale: NDArray[numpy.float64] | None = None,
    q_extra: NDArray[numpy.float64] | None = None,
    rate: NDArray[numpy.float64] | None = None,
    alpha: NDArray[numpy.float64] | None = None,
    r_extra: NDArray[numpy.float64] | None = None,
    jerk: NDArray[numpy.float64] | None = None,
    reset: NDArray[numpy.float64] | None = None,
    force: NDArray[numpy.float64] | None = None,
) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64]]: ...
def moments(
    b_omega: NDArray[numpy.float64],
    y: NDArray[numpy.float64],
    omega: NDArray[numpy.float64],
    dt: NDArray[numpy.float64],
    r_scale: NDArray[numpy.float64] | None = None,
) -> tuple[
    NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.float64], float, float
]: ...
def turn(
    phi: NDArray[numpy.float64], runs: NDArray[numpy.int64], x: NDArray[numpy.float64] | None = None
) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64]]: ...
def lengths(vectors: NDArray[numpy.float64]) -> NDArray[numpy.float64]: ...
def statistics(
    x: NDArray[numpy.float64], runs: NDArray[numpy.int64]
) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64]]: ...
def moving_mean(x: NDArray[numpy.float64], half: int) -> NDArray[numpy.float64]: ...
def moving_statistics(
    x: NDArray[numpy.float64], size: int
) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64]]: ...
def noise_variance(x: NDArray[numpy.float64], half: int) -> NDArray[numpy.float64]: ...
def squared_differences(
    x: NDArray[numpy.float64], fresh: int, spans: NDArray[numpy.int64]
) -> NDArray[numpy.float64]: ...
def mean_rates(
    rate: NDArray[numpy.float64], bias: NDArray[numpy.float64], dt: NDArray[numpy.float64]
) -> NDArray[numpy.float64]: ...
def spikes(acc: NDArray[numpy.float64], rate: NDArray[numpy.float64]) -> NDArray[numpy.float64]: ...
def stuck_odds(
    counts: NDArray[numpy.int32], gap: NDArray[numpy.bool_], edges: NDArray[numpy.int64], errors: float, sound: float
) -> NDArray[numpy.float64]: ...
def instruction_set() -> str: ...
def use_instruction_set(name: str) -> None: ...
