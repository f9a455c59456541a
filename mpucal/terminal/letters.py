"""Characters that a terminal can show, and large letters, readable from across a table."""

from __future__ import annotations

import codecs
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TextIO

GAP = 1
_HALVES = {"  ": " ", "# ": "▀", " #": "▄", "##": "█"}
# Blocks of letters: their names, and five rows of pictures, one column apart.
_SHEET = """
ABCDEFGHIJKLMN
 ###  ####   #### ####  ##### #####  #### #   # #####   ### #  #  #     #   # #   #
#   # #   # #     #   # #     #     #     #   #   #       # # #   #     ## ## ##  #
##### ####  #     #   # ####  ####  #  ## #####   #       # ##    #     # # # # # #
#   # #   # #     #   # #     #     #   # #   #   #   #   # # #   #     #   # #  ##
#   # ####   #### ####  ##### #      #### #   # #####  ###  #  #  ##### #   # #   #

OPQRSTUVWXYZ01
 ###  ####   ###  ####   #### ##### #   # #   # #   # #   # #   # #####  ###    #
#   # #   # #   # #   # #       #   #   # #   # #   #  # #   # #     #  #  ##  ##
#   # ####  # # # ####   ###    #   #   # #   # # # #   #     #     #   # # #   #
#   # #     #  #  #  #      #   #   #   #  # #  ## ##  # #    #    #    ##  #   #
 ###  #      ## # #   # ####    #    ###    #   #   # #   #   #   #####  ###  #####

23456789,:+-
####  ####  #  #  #####  ###  #####  ###   ###
    #     # #  #  #     #        #  #   # #   #         #     #
 ###   ###  ##### ####  ####    #    ###   ####             ##### #####
#         #    #      # #   #  #    #   #     #   #     #     #
##### ####     #  ####   ###  #      ###   ###   #
"""
_UNKNOWN = [" ### ", "#   #", "  ## ", "     ", "  #  "]
WIDTH = max(map(len, _UNKNOWN))
# Rows of two lines of letters of half the height, with a gap below each.
TWO_ROWS = len(_UNKNOWN) + GAP


def _cut(sheet: str) -> Iterator[tuple[str, list[str]]]:
    """Yield the name and the rows of each letter."""
    for block in sheet.strip("\n").split("\n\n"):
        names, *rows = block.split("\n")
        for k, name in enumerate(names):
            first = k * (WIDTH + GAP)
            yield name, [row[first : first + WIDTH].ljust(WIDTH) for row in rows]


_LETTERS = {" ": [" " * WIDTH] * len(_UNKNOWN), **dict(_cut(_SHEET))}


def width(text: str, scale: int = 1) -> int:
    """Return the number of columns that `large` needs."""
    return max(len(text) * (WIDTH + GAP) - GAP, 0) * scale


def large(text: str, block: str, scale: int = 1) -> list[str]:
    """Return 5 * scale rows of `block` and spaces that show `text`."""
    letters = [_LETTERS.get(letter, _UNKNOWN) for letter in text.upper()]
    rows = []
    for parts in zip(*letters, strict=True):
        row = (" " * GAP).join(parts)
        rows += ["".join((block if dot == "#" else " ") * scale for dot in row)] * scale
    return rows


def fit(columns: int) -> int:
    """Return the number of letters that fit in `columns`."""
    return (columns + GAP) // (WIDTH + GAP)


def two_lines(first: str, second: str) -> list[str]:
    """Return TWO_ROWS rows of half blocks that show two lines of text."""
    upper, lower = (large(text, "#") for text in (first, second))
    most = max(len(upper[0]), len(lower[0]))
    dots = [row.ljust(most) for row in (*upper, "", *lower, "")]
    return [
        "".join(_HALVES[above + below] for above, below in zip(*pair, strict=True))
        for pair in zip(dots[::2], dots[1::2], strict=True)
    ]


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
