"""The rows below the pictures: stillness, uncertainties, the last caution, the keys."""

from __future__ import annotations

import textwrap

from rich.text import Text

from ..session.events import PromptKind
from .glyphs import Glyphs
from .view import View
from .words import Group, groups, sentence

KNOWLEDGE_ROWS = 3
_LABEL, _NEEDLE = 19, 20
_WIDE = 110
# words are wrapped no narrower, and cut instead
NARROWEST = 12
# a warning is loud for so long, and then remembered quietly
LOUD_S = 6.0
# on a narrow screen, bars are left out and what they show is said
NARROW = 60
KEYS_NARROW, KEYS_REDO_NARROW = "Enter: on  q: stop", "Enter: on  r: again  q: stop"
KEYS = "Enter: go on now    q or Ctrl-C: stop"
KEYS_REDO = "Enter: go on now    r: turn it again from the start    q or Ctrl-C: stop"


def bar(share: float, columns: int, glyphs: Glyphs) -> str:
    """`columns` characters, the given share of them full."""
    full = round(min(max(share, 0.0), 1.0) * columns)
    return glyphs.full * full + glyphs.empty * (columns - full)


def meter(view: View, columns: int, glyphs: Glyphs) -> Text:
    """The needle between still and moving, and what moves the board or what is waited for."""
    m = view.meter
    if m is None:
        return Text("")
    # the limit of stillness stands in the middle
    at = min(int(0.5 * m.level * _NEEDLE), _NEEDLE - 1)
    cells = [glyphs.full if k <= at else glyphs.empty for k in range(_NEEDLE)]
    cells[_NEEDLE // 2] = glyphs.mark
    style = "green" if m.still else "yellow"
    waiting = view.waiting
    said = "still" if m.still else m.what or "moving"
    if waiting is not None and waiting.remaining_s > 0.0:
        said = f"{waiting.remaining_s:.0f} s to go{' (paused)' if waiting.paused else ''}, {said}"
    if columns < NARROW:
        return Text(f" {said}", style=style)
    return Text.assemble(f" {'stillness':<{_LABEL}}", ("".join(cells), style), f"  {said}")


def knowledge_rows(view: View, columns: int, glyphs: Glyphs) -> list[Text]:
    """KNOWLEDGE_ROWS rows: the uncertainty of each group of parameters, or what there is to say instead."""
    kind = view.prompt.kind if view.prompt is not None else None
    if kind is PromptKind.VERIFY and view.verified:
        rows = [_said(v.text, "green" if v.agrees else "bold yellow") for v in view.verified[-KNOWLEDGE_ROWS:]]
    elif view.confirming and columns < NARROW:
        rows = [_said(line, "") for line in textwrap.wrap(view.confirming, max(columns - 2, NARROWEST))]
    elif kind is PromptKind.REST or view.knowledge is None:
        rows = [*_progress(view, glyphs), *(_said(note, "") for note in view.notes[-2:])]
    else:
        rows = [_group(group, columns, glyphs) for group in groups(view.knowledge)]
    return [*rows, *[Text("")] * KNOWLEDGE_ROWS][:KNOWLEDGE_ROWS]


def caution_rows(view: View, columns: int, glyphs: Glyphs) -> list[Text]:
    """Two rows: the last warning, and what to do about it."""
    c = view.caution
    if c is None or view.now_s is None:
        doubt = view.knowledge.doubt if view.knowledge is not None else ""
        said, style = (f"! {sentence(doubt)}" if doubt else "", ""), "bold yellow"
    else:
        age_s = view.now_s - c.t_s
        loud = age_s <= LOUD_S
        said = (f"! {sentence(c.what)}{'' if loud else f' ({age_s:.0f} s ago)'}", f"{glyphs.arrow} {sentence(c.do)}")
        style = "bold yellow reverse" if loud else "dim"
    return [
        Text.assemble(" ", (textwrap.shorten(line, max(columns - 2, NARROWEST), placeholder=" ..."), style))
        for line in said
    ]


def keys(view: View, columns: int) -> Text:
    """What can be pressed."""
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
    """The least certain axis of a group; all three where there is space."""
    least = group.progress[group.worst]
    if columns < NARROW:
        return Text(f" {group.name:<{_LABEL}}{'xyz'[group.worst]} {group.said(group.worst)}")
    shown = range(3) if columns >= _WIDE else (group.worst,)
    values = "  ".join(f"{'xyz'[i]} {group.said(i)}" for i in shown)
    style = "green" if least >= 1.0 else "cyan"
    text = Text.assemble(f" {group.name:<{_LABEL}}", (bar(least, _NEEDLE, glyphs), style), f"  {values}")
    return text.append(f"  (target {group.target:g})", style="dim")


def _said(text: str, style: str) -> Text:
    return Text(f" {text}", style=style)
