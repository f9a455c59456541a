"""The kernel's Python face; see filter.hpp for what each array means."""

from numpy import float64, int64
from numpy.typing import NDArray

_Array = NDArray[float64]

layout: str  # of the parameters that it was built for, parameters.LAYOUT

def evaluate(
    theta: _Array,
    constants: _Array,
    lanes: int,
    y: _Array,
    omega: _Array,
    dt: _Array,
    r_scale: _Array | None = None,
    q_scale: _Array | None = None,
    q_extra: _Array | None = None,
    ends: NDArray[int64] | None = None,
) -> tuple[float, float, _Array, _Array]: ...
def evaluate_hand(
    theta: _Array,
    constants: _Array,
    derivatives: bool,
    y: _Array,
    omega: _Array,
    dt: _Array,
    r_scale: _Array | None = None,
    q_scale: _Array | None = None,
    q_extra: _Array | None = None,
    rate: _Array | None = None,
    alpha: _Array | None = None,
    r_extra: _Array | None = None,
    jerk: _Array | None = None,
    reset: _Array | None = None,
    ends: NDArray[int64] | None = None,
) -> tuple[float, float, _Array, _Array]: ...
def trace_hand(
    theta: _Array,
    constants: _Array,
    y: _Array,
    omega: _Array,
    dt: _Array,
    r_scale: _Array | None = None,
    q_scale: _Array | None = None,
    q_extra: _Array | None = None,
    rate: _Array | None = None,
    alpha: _Array | None = None,
    r_extra: _Array | None = None,
    jerk: _Array | None = None,
    reset: _Array | None = None,
) -> tuple[_Array, _Array, _Array]: ...
def moments(
    b_omega: _Array, y: _Array, omega: _Array, dt: _Array, r_scale: _Array | None = None
) -> tuple[_Array, _Array, _Array, _Array, float, float]: ...
def turn(phi: _Array, x: _Array | None = None) -> tuple[_Array, _Array]: ...
def statistics(x: _Array, runs: NDArray[int64]) -> tuple[_Array, _Array]: ...
def moving_mean(x: _Array, half: int) -> _Array: ...
def instruction_set() -> str: ...
def use_instruction_set(name: str) -> None: ...
