"""A final calibration together with what its verification found: `quality.verification`, and its reason and verdict."""

from __future__ import annotations

from dataclasses import asdict, replace

from ...result.calibration import REFUSED, USABLE, Calibration
from ...result.keys import Quality
from ..events import Checked

_FOUND = "agrees", "magnitude_mps2", "magnitude_std_mps2", "direction_deg", "direction_std_deg", "down"


def verified(calibration: Calibration, checked: Checked | None) -> Calibration:
    """The calibration with `quality.verification`.

    Refused where the new orientations disagree with it, usable at most where none was shown. Without a verification
    (the source ended, the person had enough) nothing is added.
    """
    if checked is None:
        return calibration
    found = [{key: value for key, value in asdict(rest).items() if key in _FOUND} for rest in checked.found]
    quality: Quality = {
        **calibration.quality,
        "verification": {"agrees": checked.agrees, "orientations": found},
    }
    if checked.reason is not None:
        others = [r for r in quality["reasons"] if r["code"] != checked.reason.code]
        refused = checked.agrees is not None or quality["verdict"] == REFUSED
        reasons = [checked.reason.document(), *others]
        quality = {**quality, "verdict": REFUSED if refused else USABLE, "reasons": reasons}
    return replace(calibration, quality=quality)
