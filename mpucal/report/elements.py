"""The HTML elements that the report is made of; text from outside is escaped here."""

from __future__ import annotations

import math
from collections.abc import Iterable
from html import escape
from typing import Any


def section(title: str, *content: str) -> str:
    """A part of the page under its heading; empty without content."""
    text = "".join(content)
    return f"<section>\n<h2>{escape(title)}</h2>\n{text}</section>\n" if text else ""


def heading(text: str) -> str:
    """A heading within a section."""
    return f"<h3>{escape(text)}</h3>\n"


def paragraph(text: str, id_: str = "", note: bool = False) -> str:
    """A paragraph; a note is printed fainter."""
    attributes = (f' id="{id_}"' if id_ else "") + (' class="note"' if note else "")
    return f"<p{attributes}>{escape(text)}</p>\n"


def code(text: str, id_: str) -> str:
    """Text for a machine."""
    return f'<pre id="{id_}">{escape(text)}</pre>\n'


def figure(svg: str, caption: str) -> str:
    """A picture (markup of our own) and what to see in it; empty without picture."""
    return f"<figure>{svg}<figcaption>{escape(caption)}</figcaption></figure>\n" if svg else ""


def table(id_: str, caption: str, head: Iterable[str], rows: Iterable[Iterable[str]], words: bool = False) -> str:
    """A table whose rows begin with their names; `words`: the cells are text rather than numbers."""
    cell = '<td class="words">' if words else "<td>"
    lines = [f'<div class="wide"><table id="{id_}">']
    if caption:
        lines.append(f"<caption>{escape(caption)}</caption>")
    columns = "".join(f'<th scope="col">{escape(name)}</th>' for name in head)
    if columns:
        lines.append(f"<tr>{columns}</tr>")
    for name, *values in rows:
        cells = "".join(f"{cell}{escape(value)}</td>" for value in values)
        lines.append(f'<tr><th scope="row">{escape(name)}</th>{cells}</tr>')
    return "\n".join([*lines, "</table></div>\n"])


def number(value: Any, decimals: int = 6) -> str:
    """A number, or that it is not known."""
    known = as_float(value)
    return f"{known:.{decimals}f}" if math.isfinite(known) else "unknown"


def quantity(value: Any, unit: str, sign: str = "") -> str | None:
    """A number with its unit; None where it is not known."""
    known = as_float(value)
    return f"{sign}{known:.6g} {unit}".rstrip() if math.isfinite(known) else None


def as_float(value: Any) -> float:
    """NaN for None."""
    return math.nan if value is None else float(value)
