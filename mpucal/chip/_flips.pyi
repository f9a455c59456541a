"""Made by tools/make/stubs.py from the compiled module; its functions say what they do."""

import numpy
from numpy.typing import NDArray

def until_jumps(
    run: NDArray[numpy.int16], ends: NDArray[numpy.int64], median: NDArray[numpy.float64]
) -> tuple[int, list[tuple[int, int]]]: ...
