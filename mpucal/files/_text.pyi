"""Tables of numbers as text, both ways; see text.cpp."""

from collections.abc import Sequence

from ..data import Vector

def lines(table: Vector) -> bytes: ...
def numbers(text: bytes, width: int, places: Sequence[int]) -> Vector | None: ...
