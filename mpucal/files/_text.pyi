"""Made by tools/make/stubs.py from the compiled module; its functions say what they do."""

from collections.abc import Sequence

import numpy
from numpy.typing import NDArray

def lines(table: NDArray[numpy.float64]) -> bytes: ...
def numbers(text: bytes, width: int, places: Sequence[int]) -> NDArray[numpy.float64] | None: ...
