"""Texts of the export forms in the languages of their readers, with $places for the numbers."""

from __future__ import annotations

from pathlib import Path
from string import Template


def fill(name: str, **values: object) -> str:
    """Return the template of that name with its places filled.

    Raises
    ------
    KeyError : a place has no value.
    """
    text = (Path(__file__).parent / f"{name}.txt").read_text(encoding="utf-8")
    return Template(text).substitute(values)
