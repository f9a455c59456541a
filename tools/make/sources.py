"""Makes docs/sources.md from the table in mpucal/sources/table.py."""

from __future__ import annotations

from collections.abc import Iterable

from mpucal.sources.kind import Option, SourceKind
from mpucal.sources.table import SOURCES, unique

HEAD = """# Sources

A command that measures takes exactly one source. This page is made by `python -m tools.make pages` from the table in
`mpucal/sources/table.py`, from which the options, their help and the messages about them are made, too.
"""


def page(_old: str) -> str:
    """The whole page."""
    sources = ["| source | is | its value | options beside it | commands |", "|---|---|---|---|---|"]
    options = ["| option | what it sets | default | of |", "|---|---|---|---|"]
    rows = unique(option for kind in SOURCES for option in (*kind.options, *kind.settings))
    return "\n".join([HEAD, *sources, *map(_source, SOURCES), "", *options, *map(_option, rows)]) + "\n"


def _source(kind: SourceKind) -> str:
    beside = _listed(option.flag for option in (*kind.options, *kind.settings)) or "none"
    return _row(f"`{kind.flag}`", kind.what, kind.forms, beside, _listed(kind.commands))


def _option(option: Option) -> str:
    value = "\\|".join(option.choices) or option.metavar
    default = "none" if option.default is None else f"{float(option.default):g}"
    kinds = (kind.flag for kind in SOURCES if option in (*kind.options, *kind.settings))
    return _row(f"`{option.flag} {value}`", option.help, default, _listed(kinds))


def _listed(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"
