"""Layout of a session's screen: a view in, lines of text out."""

from __future__ import annotations

import textwrap

from rich.text import Text

from ..session.events import PromptKind
from ..session.step import SAY_AGAIN_S
from . import letters, pictures
from .console import Group, count, groups, sentence
from .letters import Glyphs
from .view import View

# Smaller screens show text only.
LEAST_ROWS = 20
_LEAST_PICTURE_ROWS = 5
_BLANK = Text("")
KNOWLEDGE_ROWS = 3
_LABEL = 19
_TURN = "turn it "
# Text is wrapped to at least this width; on narrower screens it is cut.
NARROWEST = 12
# Below this width no bars are shown; from twice this on letters are large, and the values are those of all axes.
NARROW = 60
KEYS_NARROW, KEYS_REDO_NARROW = "Enter: skip  q: stop", "Enter: skip  r: again  q: stop"
KEYS = "Enter: skip ahead    q or Ctrl-C: stop"
KEYS_REDO = "Enter: skip ahead    r: restart the turning    q or Ctrl-C: stop"


def lines(view: View, columns: int, rows: int, glyphs: Glyphs) -> list[Text]:
    """Return exactly `rows` lines of at most `columns` characters."""
    roomy = columns >= NARROW and rows >= LEAST_ROWS
    air = [_BLANK] if rows >= 30 else []
    headline = _headline(view, columns, rows, glyphs)
    # A prompt has two rows; a headline of two lines leaves it one.
    prompt = _prompt(view, columns, 2 - (len(headline) == letters.TWO_ROWS))
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
    large = columns >= 2 * NARROW and rows >= 2 * LEAST_ROWS
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
    wanted = f"{_TURN}like this"
    if len(wanted) > board_columns:
        wanted = wanted.removeprefix(_TURN)
    for name, style, attitude in zip(("now", wanted), ("", "yellow"), attitudes, strict=False):
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
        # Replacements may be longer, so each style keeps its own part of the text.
        edges = sorted({edge for span in line.spans for edge in (span.start, span.end)})
        parts = ((part.plain, part.spans[0].style if part.spans else "") for part in line.divide(edges))
        replaced = ((text.translate(glyphs.replacements), style) for text, style in parts)
        line = Text.assemble(*replaced, style=line.style)
    line.truncate(columns)
    return line


def bar_columns(columns: int) -> int:
    """Return the length of a bar on a screen of `columns`, 20 at most."""
    # A label and the longest text beside a bar take 53: a narrow screen shortens the bar rather than the text.
    return min(max(columns - 53, 0), 20)


def bar(share: float, columns: int, glyphs: Glyphs) -> str:
    """Return a bar of `columns` characters, the given share of them full."""
    full = round(min(max(share, 0.0), 1.0) * columns)
    return glyphs.full * full + glyphs.empty * (columns - full)


def meter(view: View, columns: int, glyphs: Glyphs) -> Text:
    """Return the needle between still and moving, and the largest motion or the remaining time."""
    m = view.meter
    if m is None:
        return Text("")
    style = "green" if m.still else "yellow"
    waiting = view.waiting
    text = "still" if m.still else m.what or "moving"
    if waiting is not None and waiting.remaining_s > 0.0:
        text = f"{waiting.remaining_s:.0f} s to go{' (paused)' if waiting.paused else ''}, {text}"
    if columns < NARROW:
        return Text(f" {text}", style=style)
    # The limit of stillness is in the middle.
    length = bar_columns(columns)
    at = min(int(0.5 * m.level * length), length - 1)
    cells = [glyphs.full if k <= at else glyphs.empty for k in range(length)]
    cells[length // 2] = glyphs.mark
    return Text.assemble(f" {'stillness':<{_LABEL}}", ("".join(cells), style), f"  {text}")


def knowledge_rows(view: View, columns: int, glyphs: Glyphs) -> list[Text]:
    """Return KNOWLEDGE_ROWS rows: uncertainties by kind of parameter, or verifications, or progress and messages."""
    kind = view.prompt.kind if view.prompt is not None else None
    if kind is PromptKind.VERIFY and view.verified:
        latest = view.verified[-KNOWLEDGE_ROWS:]
        rows = [Text(f" {v.text}", style="green" if v.agrees else "bold yellow") for v in latest]
    elif view.confirming and columns < NARROW:
        rows = [Text(f" {line}") for line in textwrap.wrap(view.confirming, max(columns - 2, NARROWEST))]
    elif kind is PromptKind.REST or view.knowledge is None:
        rows = [
            *_progress(view, columns, glyphs),
            *(Text(f" {_shortened(note, columns)}") for note in view.notes[-2:]),
        ]
    else:
        rows = [_group(group, columns, glyphs) for group in groups(view.knowledge)]
    return [*rows, *[Text("")] * KNOWLEDGE_ROWS][:KNOWLEDGE_ROWS]


def caution_rows(view: View, columns: int, glyphs: Glyphs) -> list[Text]:
    """Return two rows: the last caution, and its remedy."""
    c = view.caution
    if c is None or view.now_s is None:
        doubt = view.knowledge.doubt if view.knowledge is not None else ""
        rows, style = (f"! {sentence(doubt)}" if doubt else "", ""), "bold yellow"
    else:
        age_s = view.now_s - c.t_s
        loud = age_s <= SAY_AGAIN_S
        rows = (f"! {sentence(c.what)}{'' if loud else f' ({age_s:.0f} s ago)'}", f"{glyphs.arrow} {sentence(c.do)}")
        style = "bold yellow reverse" if loud else "dim"
    return [Text.assemble(" ", (_shortened(row, columns), style)) for row in rows]


def _shortened(text: str, columns: int) -> str:
    """Return a text of one row of a screen, which ends with dots if it does not fit."""
    return textwrap.shorten(text, max(columns - 2, NARROWEST), placeholder=" ...")


def keys(view: View, columns: int) -> Text:
    """Return the row of keys."""
    kind = view.prompt.kind if view.prompt is not None else None
    turning = kind in (PromptKind.ROTATE, PromptKind.VERIFY, PromptKind.AGAIN)
    wide, narrow = (KEYS_REDO, KEYS_REDO_NARROW) if turning else (KEYS, KEYS_NARROW)
    return Text(f" {narrow if columns < max(NARROW, len(wide) + 1) else wide}", style="dim")


def _progress(view: View, columns: int, glyphs: Glyphs) -> list[Text]:
    p = view.progress
    if p is None or p.of <= 0.0:
        return []
    if columns < NARROW:
        return [Text(f" {p.text}")]
    done = bar(p.done / p.of, bar_columns(columns), glyphs)
    return [Text.assemble(f" {'progress':<{_LABEL}}", (done, "cyan"), f"  {p.text}")]


def _group(group: Group, columns: int, glyphs: Glyphs) -> Text:
    """Return the row of a group: its least certain axis, or all three where there is space."""
    shown = range(3) if columns >= 2 * NARROW else (group.worst,)
    values = "  ".join(f"{'xyz'[i]} {group.text(i)}" for i in shown)
    if columns < NARROW:
        return Text(f" {group.name:<{_LABEL}}{values}")
    least = group.progress[group.worst]
    style = "green" if least >= 1.0 else "cyan"
    text = Text.assemble(f" {group.name:<{_LABEL}}", (bar(least, bar_columns(columns), glyphs), style), f"  {values}")
    return text.append(f"  (target {group.target:g})", style="dim")
