"""State of the page as JSON: the terminal's view of the session, each event as in `--json-events`, and the result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..result.document import plain
from ..session.boards import KINDS
from ..session.events import Knowledge
from ..terminal.console import count, groups
from ..terminal.view import View
from ..terminal.voice import Announcement, in_words


@dataclass(frozen=True)
class Result:
    """Result of a session or a check, as the page shows it.

    Attributes
    ----------
    verdict : one word or two. estimated_error : a sentence. reasons : as calibration.json has them.
    values : name of each row of the table, and its cells for x, y and z. summary : further text.
    """

    verdict: str
    estimated_error: str = ""
    reasons: Sequence[Mapping[str, object]] = ()
    values: Sequence[tuple[str, Sequence[str]]] = ()
    summary: str = ""


def state(view: View, said: Announcement | None = None) -> dict[str, Any]:
    """Return the view's values and what was `said` last by name, not yet as JSON; see `changes`."""
    return {
        **vars(view),
        "moment": view.moment,
        "headline": in_words(view),
        "said": said,
        "confirming": view.confirming,
        "flat": KINDS[view.board].picture,
        "eye": view.eye._asdict(),
        "countdown": view.waiting,
        "count": None if view.progress is None else count(view.progress),
        "line": view.line,
        "known": None if view.knowledge is None else known(view.knowledge),
    }


def known(knowledge: Knowledge) -> tuple[dict[str, Any], ...]:
    """Return each kind of parameter with its target and its standard uncertainties of x, y and z."""
    return tuple(
        {
            "name": group.name,
            "target": f"{group.target:g} {group.unit}",
            "worst": group.worst,
            "axes": [
                {"times": std / group.target, "text": group.text(axis), "reached": progress >= 1.0}
                for axis, (std, progress) in enumerate(zip(group.std, group.progress, strict=True))
            ],
        }
        for group in groups(knowledge)
    )


def changes(new: Mapping[str, Any], old: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values that are new or changed, in JSON's own types."""
    return {name: plain(value) for name, value in new.items() if name not in old or value != old[name]}
