"""Words of frames that jump and come back; see flips.cpp."""

import numpy as np
from numpy.typing import NDArray

def until_jumps(
    run: NDArray[np.int16], ends: NDArray[np.int64], median: NDArray[np.float64]
) -> tuple[int, list[tuple[int, int]]]: ...
