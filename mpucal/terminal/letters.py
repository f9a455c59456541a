"""Large letters, readable from across a table: five rows of blocks each."""

from __future__ import annotations

ROWS = 5
WIDTH, GAP = 5, 1
# Rows of two lines of letters of half the height, with a gap between them.
TWO_ROWS = 6
_HALVES = {"  ": " ", "# ": "▀", " #": "▄", "##": "█"}
_UNKNOWN = " ### /#   #/  ## /     /  #  "
_LETTERS = {
    " ": "     /     /     /     /     ",
    "A": " ### /#   #/#####/#   #/#   #",
    "B": "#### /#   #/#### /#   #/#### ",
    "C": " ####/#    /#    /#    / ####",
    "D": "#### /#   #/#   #/#   #/#### ",
    "E": "#####/#    /#### /#    /#####",
    "F": "#####/#    /#### /#    /#    ",
    "G": " ####/#    /#  ##/#   #/ ####",
    "H": "#   #/#   #/#####/#   #/#   #",
    "I": "#####/  #  /  #  /  #  /#####",
    "J": "  ###/    #/    #/#   #/ ### ",
    "K": "#  # /# #  /##   /# #  /#  # ",
    "L": "#    /#    /#    /#    /#####",
    "M": "#   #/## ##/# # #/#   #/#   #",
    "N": "#   #/##  #/# # #/#  ##/#   #",
    "O": " ### /#   #/#   #/#   #/ ### ",
    "P": "#### /#   #/#### /#    /#    ",
    "Q": " ### /#   #/# # #/#  # / ## #",
    "R": "#### /#   #/#### /#  # /#   #",
    "S": " ####/#    / ### /    #/#### ",
    "T": "#####/  #  /  #  /  #  /  #  ",
    "U": "#   #/#   #/#   #/#   #/ ### ",
    "V": "#   #/#   #/#   #/ # # /  #  ",
    "W": "#   #/#   #/# # #/## ##/#   #",
    "X": "#   #/ # # /  #  / # # /#   #",
    "Y": "#   #/ # # /  #  /  #  /  #  ",
    "Z": "#####/   # /  #  / #   /#####",
    "0": " ### /#  ##/# # #/##  #/ ### ",
    "1": "  #  / ##  /  #  /  #  /#####",
    "2": "#### /    #/ ### /#    /#####",
    "3": "#### /    #/ ### /    #/#### ",
    "4": "#  # /#  # /#####/   # /   # ",
    "5": "#####/#    /#### /    #/#### ",
    "6": " ### /#    /#### /#   #/ ### ",
    "7": "#####/   # /  #  / #   /#    ",
    "8": " ### /#   #/ ### /#   #/ ### ",
    "9": " ### /#   #/ ####/    #/ ### ",
    ",": "     /     /     /  #  / #   ",
    ":": "     /  #  /     /  #  /     ",
    "+": "     /  #  /#####/  #  /     ",
    "-": "     /     /#####/     /     ",
}


def width(text: str, scale: int = 1) -> int:
    """Return the number of columns that `large` needs."""
    return max(len(text) * (WIDTH + GAP) - GAP, 0) * scale


def large(text: str, block: str, scale: int = 1) -> list[str]:
    """Return ROWS * scale rows of `block` and spaces that show `text`."""
    letters = [_LETTERS.get(letter, _UNKNOWN).split("/") for letter in text.upper()]
    rows = []
    for k in range(ROWS):
        row = (" " * GAP).join(letter[k] for letter in letters)
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
