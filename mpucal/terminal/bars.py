"""Rows below the pictures: stillness, uncertainties, the last caution, the keys."""

from __future__ import annotations

import textwrap

from rich.text import Text

from ..session.events import PromptKind
from ..session.step import SAY_AGAIN_S
from .console import Group, groups, sentence
from .letters import Glyphs
from .view import View

KNOWLEDGE_ROWS = 3
_LABEL, _NEEDLE = 19, 20
# Text is wrapped to at least this width; on narrower screens it is cut.
NARROWEST = 12
# Below the first width no bars are shown; from the second on letters are large, and the values are those of all axes.
NARROW, LARGE_COLUMNS = 60, 120
KEYS_NARROW, KEYS_REDO_NARROW = "Enter: skip  q: stop", "Enter: skip  r: again  q: stop"
KEYS = "Enter: skip ahead    q or Ctrl-C: stop"
KEYS_REDO = "Enter: skip ahead    r: restart the turning    q or Ctrl-C: stop"


def bar(share: float, columns: int, glyphs: Glyphs) -> str:
    """Return a bar of `columns` characters, the given share of them full."""
    full = round(min(max(share, 0.0), 1.0) * columns)
    return glyphs.full * full + glyphs.empty * (columns - full)


def meter(view: View, columns: int, glyphs: Glyphs) -> Text:
    """Return the needle between still and moving, and the largest motion or the remaining time."""
    m = view.meter
    if m is None:
        return Text("")
    # The limit of stillness is in the middle.
    at = min(int(0.5 * m.level * _NEEDLE), _NEEDLE - 1)
    cells = [glyphs.full if k <= at else glyphs.empty for k in range(_NEEDLE)]
    cells[_NEEDLE // 2] = glyphs.mark
    style = "green" if m.still else "yellow"
    waiting = view.waiting
    text = "still" if m.still else m.what or "moving"
    if waiting is not None and waiting.remaining_s > 0.0:
        text = f"{waiting.remaining_s:.0f} s to go{' (paused)' if waiting.paused else ''}, {text}"
    if columns < NARROW:
        return Text(f" {text}", style=style)
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
        rows = [*_progress(view, glyphs), *(Text(f" {note}") for note in view.notes[-2:])]
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
    width = max(columns - 2, NARROWEST)
    return [Text.assemble(" ", (textwrap.shorten(row, width, placeholder=" ..."), style)) for row in rows]


def keys(view: View, columns: int) -> Text:
    """Return the row of keys."""
    kind = view.prompt.kind if view.prompt is not None else None
    turning = kind in (PromptKind.ROTATE, PromptKind.VERIFY, PromptKind.AGAIN)
    wide, narrow = (KEYS_REDO, KEYS_REDO_NARROW) if turning else (KEYS, KEYS_NARROW)
    return Text(f" {narrow if columns < NARROW else wide}", style="dim")


def _progress(view: View, glyphs: Glyphs) -> list[Text]:
    p = view.progress
    if p is None or p.of <= 0.0:
        return []
    return [Text.assemble(f" {'progress':<{_LABEL}}", (bar(p.done / p.of, _NEEDLE, glyphs), "cyan"), f"  {p.text}")]


def _group(group: Group, columns: int, glyphs: Glyphs) -> Text:
    """Return the row of a group: its least certain axis, or all three where there is space."""
    shown = range(3) if columns >= LARGE_COLUMNS else (group.worst,)
    values = "  ".join(f"{'xyz'[i]} {group.text(i)}" for i in shown)
    if columns < NARROW:
        return Text(f" {group.name:<{_LABEL}}{values}")
    least = group.progress[group.worst]
    style = "green" if least >= 1.0 else "cyan"
    text = Text.assemble(f" {group.name:<{_LABEL}}", (bar(least, _NEEDLE, glyphs), style), f"  {values}")
    return text.append(f"  (target {group.target:g})", style="dim")
