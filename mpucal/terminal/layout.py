"""Layout of a session's screen: a view in, lines of text out."""

from __future__ import annotations

import textwrap

from rich.text import Text

from ..session.events import PromptKind
from . import letters, pictures
from .bars import LARGE_COLUMNS, NARROW, NARROWEST, caution_rows, keys, knowledge_rows, meter
from .console import count, sentence
from .letters import Glyphs
from .view import View

# Smaller screens show text only.
LEAST_ROWS, LARGE_ROWS, AIRY_ROWS = 20, 40, 30
_PROMPT_ROWS, _LEAST_PICTURE_ROWS = 2, 5
_BLANK = Text("")


def lines(view: View, columns: int, rows: int, glyphs: Glyphs) -> list[Text]:
    """Return exactly `rows` lines of at most `columns` characters."""
    roomy = columns >= NARROW and rows >= LEAST_ROWS
    air = [_BLANK] if rows >= AIRY_ROWS else []
    headline = _headline(view, columns, rows, glyphs)
    # A headline of two lines leaves one row less.
    prompt = _prompt(view, columns, _PROMPT_ROWS - (len(headline) == letters.TWO_ROWS))
    above = [_status(view, columns, glyphs), *air, *headline, *prompt]
    below = [
        meter(view, columns, glyphs),
        *knowledge_rows(view, columns, glyphs),
        *caution_rows(view, columns, glyphs),
        keys(view, columns),
    ]
    line = _finish_line(view, glyphs)
    space = rows - len(above) - len(below) - len(line)
    # The pictures say more than the finish line.
    if line and roomy and space == _LEAST_PICTURE_ROWS - 1:
        line, space = [], _LEAST_PICTURE_ROWS
    above += line
    between = _pictures(view, columns, space, glyphs) if roomy and space >= _LEAST_PICTURE_ROWS else []
    between += [_BLANK] * max(space - len(between), 0)
    drawn = [*above, *between, *below]
    # A screen with too few rows loses its bars first, and never the headline and the prompt.
    if len(drawn) > rows:
        drawn = [*drawn[: max(rows - 2, 1)], *drawn[-2:]][:rows]
    return [_cut(line, columns, glyphs) for line in drawn]


def _status(view: View, columns: int, glyphs: Glyphs) -> Text:
    minutes, seconds = divmod(int(view.elapsed_s), 60)
    facts = [f"{minutes}:{seconds:02d}"]
    if view.meter is not None:
        facts.insert(0, f"{view.meter.rate_hz:.1f} Hz")
        if view.meter.temperature_c is not None:
            facts.insert(1, f"{view.meter.temperature_c:.1f} °C")
    # A narrow screen keeps the clock alone.
    right = "   ".join(facts) if columns >= NARROW else facts[-1]
    # Replacements may be longer, and the clock comes last.
    right, title = (text.translate(glyphs.replacements) for text in (right, view.title))
    space = max(columns - len(right) - 3, 1)
    return Text(f" {title[:space]:<{space}} {right} ", style="reverse")


def _headline(view: View, columns: int, rows: int, glyphs: Glyphs) -> list[Text]:
    text = view.headline
    style = _headline_style(view)
    large = columns >= LARGE_COLUMNS and rows >= LARGE_ROWS
    for scale in (2, 1) if large else (1,):
        if letters.width(text, scale) + 2 <= columns and rows >= LEAST_ROWS:
            return [Text(f" {row}", style=style) for row in letters.large(text, glyphs.block, scale)]
    pair = textwrap.wrap(text, max(letters.fit(columns - 2), 1), break_long_words=False)
    if len(pair) == 2 and glyphs.unicode and rows >= LEAST_ROWS and letters.width(max(pair, key=len)) + 2 <= columns:
        return [Text(f" {row}", style=style) for row in letters.two_lines(*pair)]
    return [Text(f" {text}", style=f"{style} reverse")]


def _headline_style(view: View) -> str:
    if view.prompt is None or view.prompt.kind is PromptKind.REST:
        return "bold"
    return "bold cyan" if view.waiting is None else "bold green"


def _prompt(view: View, columns: int, rows: int) -> list[Text]:
    text = view.prompt.text if view.prompt is not None else "Looking for the sensor."
    wrapped = textwrap.wrap(text, max(columns - 2, NARROWEST), max_lines=rows, placeholder=" ...")
    return [Text(f" {line}", style="bold") for line in [*wrapped, *[""] * (rows - len(wrapped))]]


def _finish_line(view: View, glyphs: Glyphs) -> list[Text]:
    """Return the finish line: a mark for each orientation, the count, and the time that is left."""
    taken, of = view.line
    if (
        view.progress is None
        or not of
        or (view.prompt and view.prompt.kind is PromptKind.ROTATE and not view.knowledge)
    ):
        return []
    done, next_one, to_come = glyphs.line
    marks = f"{done * taken}{next_one * (taken < of)}{to_come * (of - taken - 1)}"
    words = sentence(count(view.progress).removeprefix("orientation "))
    return [Text.assemble(" ", (marks, "green"), f"  {words}")]


def _pictures(view: View, columns: int, rows: int, glyphs: Glyphs) -> list[Text]:
    """Return the pictures of the board as it is and as it is wanted, and the map of its orientations."""
    height = rows - 1
    quarter = (columns - 4) // 4
    board_columns, map_columns = min(quarter + 2, 4 * height), min(quarter - 2, 2 * height)
    parts: list[tuple[str, list[Text], int]] = []
    attitudes = (view.meter.attitude, view.meter.wanted) if view.meter is not None else ()
    for name, style, attitude in zip(("now", "turn it like this"), ("", "yellow"), attitudes, strict=False):
        if attitude is not None:
            canvas = pictures.draw_board(view.board, attitude, view.eye, board_columns, height)
            parts.append((name, canvas.lines(style, glyphs.unicode), board_columns))
    if view.confirming and height > 2:
        text_columns = columns - board_columns - 3
        question = ["", *textwrap.wrap(view.confirming, text_columns), *[""] * height][:height]
        parts.append(("", [Text(line, style="bold") for line in question], text_columns))
    marks = _marks(view)
    if marks:
        for upper, name in ((False, "+Z up"), (True, "-Z up")):
            canvas = pictures.draw_half(upper, marks, map_columns, height, glyphs.unicode)
            parts.append((name, canvas.lines("", glyphs.unicode), map_columns))
    names = Text(" ").join(Text(name[:width].center(width), style="dim") for name, _, width in parts)
    return [names, *(Text(" ").join(_filled(rows[k], width) for _, rows, width in parts) for k in range(height))]


def _marks(view: View) -> list[tuple[str, tuple[float, float, float]]]:
    marks = [("passed", s.down) for s in view.seen if not s.paused]
    marks += [("held", s.down) for s in view.seen if s.paused]
    if view.wanted is not None:
        marks.append(("wanted", view.wanted))
    if marks and view.meter is not None:
        marks.append(("now", view.meter.down))
    return marks


def _filled(text: Text, columns: int) -> Text:
    text.pad_right(max(columns - len(text.plain), 0))
    return text


def _cut(line: Text, columns: int, glyphs: Glyphs) -> Text:
    if not glyphs.unicode:
        line.plain = line.plain.translate(glyphs.replacements)
    line.truncate(columns)
    return line
