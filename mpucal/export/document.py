"""A calibration as calibration.json: of a config blob, what the blob holds, with no digit lost."""

from __future__ import annotations

from ..result.calibration import Calibration

ENDING = ".json"


def export(calibration: Calibration) -> tuple[str, tuple[str, ...]]:
    """The document's text; it carries everything, of a refused calibration too."""
    return calibration.json(), ()
