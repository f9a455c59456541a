"""The HTML elements that the report is made of; text from outside is escaped here."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from html import escape as without_marks
from typing import Any

from ..errors import plain


def escape(text: str) -> str:
    """Text from anywhere as a page only shows it."""
    return without_marks(plain(text))


def section(title: str, *content: str) -> str:
    """A part of the page under its heading; empty without content."""
    text = "".join(content)
    return f"<section>\n<h2>{escape(title)}</h2>\n{text}</section>\n" if text else ""


def details(title: str, *content: str) -> str:
    """A part of the page that is folded away, and not printed while it is; empty without content."""
    text = "".join(content)
    return f"<details>\n<summary>{escape(title)}</summary>\n{text}</details>\n" if text else ""


def heading(text: str) -> str:
    """A heading within a section."""
    return f"<h3>{escape(text)}</h3>\n"


def paragraph(text: str, id_: str = "", note: bool = False) -> str:
    """A paragraph; a note is printed fainter."""
    attributes = (f' id="{id_}"' if id_ else "") + (' class="note"' if note else "")
    return f"<p{attributes}>{escape(text)}</p>\n"


def code(text: str, id_: str) -> str:
    """Text for a machine; where it is wider than the page, keys scroll it."""
    return f'<pre id="{id_}" tabindex="0">{escape(text)}</pre>\n'


def figure(svg: str, caption: str) -> str:
    """A picture (markup of our own) and what to see in it; empty without picture."""
    return f"<figure>{svg}<figcaption>{escape(caption)}</figcaption></figure>\n" if svg else ""


def pair(*figures: str) -> str:
    """Figures or sections beside each other where there is room; empty without any."""
    text = "".join(figures)
    return f'<div class="pair">\n{text}</div>\n' if text else ""


def first(decision: str, values: str) -> str:
    """What is seen first: where there is room, what to do stands to the right of the values."""
    return f'<div class="first">\n{decision}{values}</div>\n'


def table(
    id_: str,
    caption: str,
    head: Iterable[str],
    rows: Iterable[Iterable[str]],
    words: int = 99,
    links: Mapping[str, str] | None = None,
) -> str:
    """A table whose rows begin with their names; from cell number `words` on they are text rather than numbers.

    `links` : by name, where it leads.
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
    """A number, or that it is not known."""
    known = as_float(value)
    return f"{known:.{decimals}f}" if math.isfinite(known) else "unknown"


def quantity(value: Any, unit: str, sign: str = "", digits: int = 6) -> str | None:
    """A number with its unit; None where it is not known."""
    known = as_float(value)
    return f"{sign}{known:.{digits}g} {unit}".rstrip() if math.isfinite(known) else None


def as_float(value: Any) -> float:
    """NaN for None."""
    return math.nan if value is None else float(value)
