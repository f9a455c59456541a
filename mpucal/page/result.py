"""Result of a session or a check, as the page shows it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass


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
