"""The page that `mpucal show` prints of a device: what its sensor's registers or parameters hold now."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np


def page(facts: Mapping[str, Any]) -> str:
    """The facts as a person reads them; see OpenedSource.contents."""
    rows = _vehicle_rows(facts) if "parameters" in facts else _chip_rows(facts) if "who_am_i" in facts else dict(facts)
    rows.pop("where", None)
    wide = max(18, *(len(key) + 2 for key in rows))
    return "\n".join(
        [f"{facts['where']}, as it is now.", "", *(f"  {key:<{wide}}{value}" for key, value in rows.items())]
    )


def _vehicle_rows(facts: Mapping[str, Any]) -> dict[str, str]:
    held = {name: value for name, value in facts["parameters"].items() if "OFF" in name or "SCAL" in name}
    corrected = [name for name, value in held.items() if value != ("SCAL" in name) and not name.startswith("SENS")]
    said = f"a correction in {len(corrected)} parameters" if corrected else "no correction of its accelerometers"
    return {"holds": said, **{name: f"{value:g}" for name, value in facts["parameters"].items()}}


def _chip_rows(facts: Mapping[str, Any]) -> dict[str, str]:
    name = facts["chip"] or "unknown chip"
    rows = {
        "chip": f"{name}, WHO_AM_I 0x{facts['who_am_i']:02x}{', asleep' if facts['asleep'] else ''}",
        "ranges": f"±{facts['accel_range_g']} g, ±{facts['gyro_range_dps']} deg/s",
    }
    for address, words in facts["accel_offsets"].items():
        rows[f"offsets at {address}"] = ", ".join(map(str, words))
    if "acc_mps2" in facts:
        acc = facts["acc_mps2"]
        rows["measures"] = f"({', '.join(f'{a:+.3f}' for a in acc)}) m/s², |a| {np.linalg.norm(acc):.3f}"
        rows["temperature"] = f"{facts['temperature_c']:.1f} °C"
    return rows
