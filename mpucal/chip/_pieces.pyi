"""Made by tools/make/stubs.py from the compiled module; its functions say what they do."""

import numpy
from numpy.typing import NDArray

def best_break(
    t: NDArray[numpy.float64], y: NDArray[numpy.float64], least: int, least_s: float
) -> tuple[int, float, float]: ...
