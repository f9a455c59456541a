"""Characters that a terminal can show: Unicode, or replacements in ASCII."""

from __future__ import annotations

import codecs
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TextIO

# The fonts of the Linux console have no braille.
_NO_BRAILLE = ("linux",)
_IN_ASCII = str.maketrans({"²": "2", "±": "+-", "°": "deg ", "−": "-", "·": "-", "→": "->", "…": "..."})


@dataclass(frozen=True)
class Glyphs:
    """Characters of pictures and bars, and `replacements` for those in texts.

    line : those of the finish line, for orientations that are taken, requested and to come.
    """

    unicode: bool
    block: str
    full: str
    empty: str
    mark: str
    arrow: str
    line: tuple[str, str, str]
    replacements: Mapping[int, str] = field(default_factory=dict)


UNICODE = Glyphs(True, "█", "█", "░", "│", "→", ("✓", "◎", "·"))
ASCII = Glyphs(False, "#", "#", "-", "|", "->", ("x", "O", "."), _IN_ASCII)


def glyphs_of(out: TextIO, term: str) -> Glyphs:
    """Return the characters for the terminal behind `out`; `term` is its TERM."""
    try:
        is_utf8 = codecs.lookup(out.encoding or "ascii").name == "utf-8"
    except LookupError:
        is_utf8 = False
    return UNICODE if is_utf8 and term not in _NO_BRAILLE else ASCII
