"""Data frames of pandas or polars, by what both have; neither is imported here unless one is to be made."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .errors import WrongType, WrongValue

Array = NDArray[Any]

TIME, ACC, GYR = ("t",), ("ax", "ay", "az"), ("gx", "gy", "gz")
OTHERS = ("temperature_c", "gap", "acc_clipped", "gyr_clipped")
WITH_UNIT = {
    "t": "t_s",
    **{name: f"{name}_mps2" for name in ACC},
    **{name: f"{name}_rad_s" for name in GYR},
}


class Frame(Protocol):
    """What a type checker knows a data frame by."""

    @property
    def columns(self) -> Any:
        """Its columns' names."""


def is_frame(value: object) -> bool:
    """Whether it is a data frame: has named columns, and gives copies of itself with some replaced."""
    return hasattr(value, "columns") and (hasattr(value, "assign") or hasattr(value, "with_columns"))


def arrays(frame: Any) -> dict[str, Any]:
    """The arguments of Recording.from_arrays that a frame holds.

    Raises
    ------
    WrongType : it is no data frame. WrongValue : a column is missing.
    """
    if not is_frame(frame):
        raise WrongType(f"{type(frame).__name__} is no data frame", "give one of pandas or polars")
    if places(frame, TIME):
        t = _columns(frame, TIME)[:, 0]
    elif getattr(getattr(frame, "index", None), "dtype", np.dtype(object)).kind in "mM":
        t = np.asarray(frame.index)
    else:
        raise _missing(TIME)
    others = {name: np.asarray(frame[name]) for name in OTHERS if name in frame.columns}
    return {"t": t, "acc": columns(frame, ACC), "gyr": columns(frame, GYR), **others}


def columns(frame: Any, names: tuple[str, ...]) -> Array:
    """(n, k) of the columns of these names, with or without their units.

    Raises
    ------
    WrongValue : one is missing.
    """
    if not places(frame, names):
        raise _missing(names)
    return _columns(frame, names)


def places(frame: Any, names: tuple[str, ...]) -> tuple[str, ...]:
    """The names that a frame has for these quantities; empty where it lacks one."""
    found = [name for wanted in names for name in (wanted, WITH_UNIT[wanted]) if name in frame.columns]
    return tuple(found) if len(found) == len(names) else ()


def replaced(frame: Any, new: Mapping[tuple[str, ...], Array]) -> Any:
    """The frame with other numbers in some columns: {quantities: (n, k)}; index, order and other columns stay."""
    values = {
        place: np.ascontiguousarray(array[:, k])
        for names, array in new.items()
        for k, place in enumerate(places(frame, names))
    }
    if hasattr(frame, "assign"):
        return frame.assign(**values)
    return frame.with_columns([type(frame[name])(name, column) for name, column in values.items()])


def made(library: str, samples: Mapping[str, Array]) -> Any:
    """A frame of samples' arrays by name.

    Raises
    ------
    WrongValue : another library. ImportError : the library is not installed.
    """
    if library not in ("pandas", "polars"):
        raise WrongValue(f"there are no data frames of {library!r} here", "choose pandas or polars")
    split = {"t": samples["t"]}
    for names, key in ((ACC, "acc"), (GYR, "gyr")):
        split |= dict(zip(names, samples[key].T, strict=True))
    named = {WITH_UNIT[name]: np.ascontiguousarray(array) for name, array in split.items()}
    return import_module(library).DataFrame({**named, **{name: samples[name] for name in OTHERS}})


def _columns(frame: Any, names: tuple[str, ...]) -> Array:
    return np.column_stack([np.asarray(frame[place]) for place in places(frame, names)])


def _missing(names: tuple[str, ...]) -> WrongValue:
    wanted = ", ".join(f"{name} or {WITH_UNIT[name]}" for name in names)
    return WrongValue(f"the data frame lacks a column of {', '.join(names)}", f"name its columns {wanted}")
