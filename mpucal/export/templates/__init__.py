"""Texts of the export forms in the languages of their readers, with $places for the numbers."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from string import Template

import numpy as np


def fill(name: str, **values: object) -> str:
    """Return the template of that name with its places filled.

    Raises
    ------
    KeyError : a place has no value.
    """
    text = (Path(__file__).parent / f"{name}.txt").read_text(encoding="utf-8")
    return Template(text).substitute(values)


def row(values: Iterable[float], form: str) -> str:
    """Return numbers in a `form` such as "{:.9g}", with commas between them."""
    return ", ".join(map(form.format, values))


def rows(matrix: Iterable[Iterable[float]], form: str, brackets: str) -> str:
    """Return the rows of a matrix, a line each within `brackets`, with commas between them."""
    return ",\n".join(f"    {brackets[0]}{row(values, form)}{brackets[1]}" for values in matrix)


def yaml_row(values: Iterable[float]) -> str:
    """Return a sequence of numbers for YAML."""
    return f"[{', '.join(map(yaml_number, values))}]"


def yaml_number(value: float) -> str:
    """Return a number for YAML, which reads 1e-05 as a word: a number needs its point."""
    return np.format_float_positional(value + 0.0, trim="0")
