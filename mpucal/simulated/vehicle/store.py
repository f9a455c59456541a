"""The parameters that a vehicle holds, in their order, with their types."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...data import Vector
from ...mavlink.parameters.encoding import REAL32, Number, Parameter, as_float32

INT8, INT16, INT32 = 2, 4, 6
AXES = ("X", "Y", "Z")


class ParameterStore:
    """Names, values and types; floats are kept as float32.

    Attributes
    ----------
    version : counts up with every change.
    """

    def __init__(self) -> None:
        self.version = 0
        self._values: dict[str, Number] = {}
        self._types: dict[str, int] = {}

    def add(self, name: str, value: Number, kind: int = REAL32) -> None:
        """A parameter that the firmware has, with its default."""
        self._types[name] = kind
        self[name] = value

    def add_vector(self, stem: str, value: float, tail: str = "") -> None:
        """Three of them: stem X tail, and so on."""
        for axis in AXES:
            self.add(f"{stem}{axis}{tail}", value)

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def __len__(self) -> int:
        return len(self._values)

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __getitem__(self, name: str) -> Number:
        return self._values[name]

    def __setitem__(self, name: str, value: Number) -> None:
        self.version += 1
        self._values[name] = as_float32(value) if self._types[name] == REAL32 else round(value)

    def type(self, name: str) -> int:
        """MAV_PARAM_TYPE."""
        return self._types[name]

    def vector(self, stem: str, tail: str = "") -> Vector:
        """(3,) of stem X tail, and so on."""
        return np.array([float(self._values[f"{stem}{axis}{tail}"]) for axis in AXES])

    def parameter(self, name: str) -> Parameter:
        """As it is sent."""
        return Parameter(name, self._values[name], self._types[name], list(self._values).index(name), len(self))
