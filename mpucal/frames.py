"""Data frames of pandas or polars, through their common interface; neither is imported unless a frame is made."""

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
    """Interface of a data frame for type checkers."""

    @property
    def columns(self) -> Any:
        """Names of the columns."""


def is_frame(value: object) -> bool:
    """Return True for a data frame: it has named columns and a method that returns a copy with some replaced."""
    return hasattr(value, "columns") and (hasattr(value, "assign") or hasattr(value, "with_columns"))


def recording_arrays(frame: Any) -> dict[str, Any]:
    """Return the arguments of Recording.from_arrays in a frame.

    Raises
    ------
    WrongType : it is not a data frame. WrongValue : a column is missing.
    """
    if not is_frame(frame):
        raise WrongType(f"{type(frame).__name__} is not a data frame", "give one of pandas or polars")
    if column_names(frame, TIME):
        t = _columns(frame, TIME)[:, 0]
    elif getattr(getattr(frame, "index", None), "dtype", np.dtype(object)).kind in "mM":
        t = np.asarray(frame.index)
    else:
        raise _missing(TIME)
    others = {name: np.asarray(frame[name]) for name in OTHERS if name in frame.columns}
    return {"t": t, "acc": columns(frame, ACC), "gyr": columns(frame, GYR), **others}


def columns(frame: Any, names: tuple[str, ...]) -> Array:
    """Return (n, k) of the columns of these names, with or without their units.

    Raises
    ------
    WrongValue : one is missing.
    """
    if not column_names(frame, names):
        raise _missing(names)
    return _columns(frame, names)


def column_names(frame: Any, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the frame's names of these quantities; empty if it lacks one."""
    found = [name for wanted in names for name in (wanted, WITH_UNIT[wanted]) if name in frame.columns]
    return tuple(found) if len(found) == len(names) else ()


def replace_columns(frame: Any, new: Mapping[tuple[str, ...], Array]) -> Any:
    """Return the frame with new numbers in some columns {quantities: (n, k)}; index, order and other columns stay."""
    values = {
        place: np.ascontiguousarray(array[:, k])
        for names, array in new.items()
        for k, place in enumerate(column_names(frame, names))
    }
    if hasattr(frame, "assign"):
        return frame.assign(**values)
    return frame.with_columns([type(frame[name])(name, column) for name, column in values.items()])


def make_frame(library: str, samples: Mapping[str, Array]) -> Any:
    """Return a frame of samples' arrays by name.

    Raises
    ------
    WrongValue : another library. ImportError : the library is not installed.
    """
    if library not in ("pandas", "polars"):
        raise WrongValue(f"data frames of {library!r} are not supported", "choose pandas or polars")
    split = {"t": samples["t"]}
    for names, key in ((ACC, "acc"), (GYR, "gyr")):
        split |= dict(zip(names, samples[key].T, strict=True))
    named = {WITH_UNIT[name]: np.ascontiguousarray(array) for name, array in split.items()}
    return import_module(library).DataFrame({**named, **{name: samples[name] for name in OTHERS}})


def _columns(frame: Any, names: tuple[str, ...]) -> Array:
    return np.column_stack([np.asarray(frame[place]) for place in column_names(frame, names)])


def _missing(names: tuple[str, ...]) -> WrongValue:
    wanted = ", ".join(f"{name} or {WITH_UNIT[name]}" for name in names)
    return WrongValue(f"the data frame lacks a column of {', '.join(names)}", f"name its columns {wanted}")
