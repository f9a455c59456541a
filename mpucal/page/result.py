"""What a session or a check came to, as a page shows it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Result:
    """What came of it.

    Attributes
    ----------
    verdict : its word. said : what matters of it, in a sentence. reasons : against it, as calibration.json has them.
    values : what was found, each with its name and three cells of x, y and z. summary : the rest, in words.
    """

    verdict: str
    said: str = ""
    reasons: Sequence[Mapping[str, object]] = ()
    values: Sequence[tuple[str, Sequence[str]]] = ()
    summary: str = ""
