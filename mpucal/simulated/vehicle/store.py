"""Parameters of a simulated vehicle, in their order."""

from __future__ import annotations

from collections import UserDict
from collections.abc import Iterable, Sequence

import numpy as np

from ...data import Vector
from ...mavlink.parameters.encoding import REAL32, Number, as_float32


class ParameterStore(UserDict[str, Number]):
    """Values by name, with types; floats are kept as float32."""

    def __init__(self) -> None:
        super().__init__()
        self._types: dict[str, int] = {}

    def add(self, name: str, value: Number, kind: int = REAL32) -> None:
        """Add a parameter of the firmware, with its default."""
        self._types[name] = kind
        self[name] = value

    def add_all(self, names: Iterable[str], value: float) -> None:
        """Add several floats with one default."""
        for name in names:
            self.add(name, value)

    def __setitem__(self, name: str, value: Number) -> None:
        super().__setitem__(name, as_float32(value) if self._types[name] == REAL32 else round(value))

    def type(self, name: str) -> int:
        """Return the MAV_PARAM_TYPE."""
        return self._types[name]

    def vector(self, names: Sequence[str]) -> Vector:
        """Return the values of several parameters."""
        return np.array([float(self[name]) for name in names])

    def set_vector(self, names: Sequence[str], values: Vector) -> None:
        """Set several parameters."""
        self.update(dict(zip(names, values.tolist(), strict=True)))
