"""The HTML elements of the report; they escape all text from outside."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from html import escape as escape_markup
from pathlib import Path
from typing import Any

from ..errors import escape_controls

CSS = (Path(__file__).parent / "report.css").read_text(encoding="utf-8")


def escape(text: str) -> str:
    """Return text as HTML that only shows it."""
    return escape_markup(escape_controls(text))


def document(title: str, heading: str, *content: str) -> str:
    """Return a whole page, which needs no network and no script."""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>\n{CSS}</style>\n</head>\n<body>\n<main>\n"
        f"<h1>{escape(heading)}</h1>\n{''.join(content)}</main>\n</body>\n</html>\n"
    )


def section(title: str, *content: str) -> str:
    """Return a part of the page under its heading; empty without content."""
    text = "".join(content)
    return f"<section>\n<h2>{escape(title)}</h2>\n{text}</section>\n" if text else ""


def details(title: str, *content: str) -> str:
    """Return a collapsed part of the page, which is not printed while it is; empty without content."""
    text = "".join(content)
    return f"<details>\n<summary>{escape(title)}</summary>\n{text}</details>\n" if text else ""


def heading(text: str) -> str:
    """Return a heading within a section."""
    return f"<h3>{escape(text)}</h3>\n"


def paragraph(text: str, id_: str = "", note: bool = False) -> str:
    """Return a paragraph; a note is fainter."""
    attributes = (f' id="{id_}"' if id_ else "") + (' class="note"' if note else "")
    return f"<p{attributes}>{escape(text)}</p>\n"


def code(text: str, id_: str) -> str:
    """Return preformatted text, which the keyboard can scroll."""
    return f'<pre id="{id_}" tabindex="0">{escape(text)}</pre>\n'


def figure(svg: str, caption: str) -> str:
    """Return a picture (our own markup) with a caption; empty without picture."""
    return f"<figure>{svg}<figcaption>{escape(caption)}</figcaption></figure>\n" if svg else ""


def pair(*figures: str) -> str:
    """Return figures or sections side by side if there is room; empty without any."""
    text = "".join(figures)
    return f'<div class="pair">\n{text}</div>\n' if text else ""


def first(decision: str, values: str) -> str:
    """Return the top of the page: the decision, to the right of the values if there is room; without it the values."""
    if not decision:
        return values
    return f'<div class="first">\n{decision}{values}</div>\n'


def table(
    id_: str,
    caption: str,
    head: Iterable[str],
    rows: Iterable[Iterable[str]],
    words: int = 99,
    links: Mapping[str, str] | None = None,
) -> str:
    """Return a table whose rows begin with their names.

    Parameters
    ----------
    words : the cells from this number on are text instead of numbers. links : row name -> URL.
    """
    lines = [f'<div class="wide"><table id="{id_}">']
    if caption:
        lines.append(f"<caption>{escape(caption)}</caption>")
    columns = "".join(f'<th scope="col">{escape(name)}</th>' if name else "<td></td>" for name in head)
    if columns:
        lines.append(f"<tr>{columns}</tr>")
    for name, *values in rows:
        kinds = ['<td class="words">' if k >= words else "<td>" for k in range(len(values))]
        cells = "".join(f"{kind}{escape(value)}</td>" for kind, value in zip(kinds, values, strict=True))
        place = (links or {}).get(name)
        named = f'<a href="{escape(place)}">{escape(name)}</a>' if place else escape(name)
        lines.append(f'<tr><th scope="row">{named}</th>{cells}</tr>')
    return "\n".join([*lines, "</table></div>\n"])


def number(value: Any, decimals: int = 6) -> str:
    """Return a number as text, or "unknown"."""
    known = as_float(value)
    return f"{known:.{decimals}f}" if math.isfinite(known) else "unknown"


def quantity(value: Any, unit: str, sign: str = "", digits: int = 6) -> str | None:
    """Return a number with its unit; None if it is not known."""
    known = as_float(value)
    return f"{sign}{known:.{digits}g} {unit}".rstrip() if math.isfinite(known) else None


def as_float(value: Any) -> float:
    """Return a float; NaN for None."""
    return math.nan if value is None else float(value)
