"""Made by tools/make/stubs.py from the compiled module; its functions say what they do."""

import numpy
from numpy.typing import NDArray

def unpacked(data: bytes) -> NDArray[numpy.uint64]: ...
def frames(data: bytes, words: int) -> NDArray[numpy.int16]: ...
