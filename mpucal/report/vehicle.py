"""The section on a vehicle: its autopilot's parameters and its other IMUs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from ..result.calibration import Calibration
from .elements import as_float, heading, paragraph, section, table
from .usual import accelerometer_table


def vehicle_section(c: Calibration) -> str:
    """Parameters before and after, and the other IMUs; empty for a sensor by itself."""
    parts = _parameters("parameters-1", c.extra.get("autopilot") or {})
    for number, document in enumerate(c.extra.get("others") or (), start=2):
        other = Calibration.from_document(document)
        parts += [
            heading(f"{other.sensor.chip or f'IMU {number}'}: {other.verdict}"),
            accelerometer_table(other, f"accelerometer-{number}"),
            *(paragraph(str(reason["message"]) + ".") for reason in other.quality.get("reasons", ())),
            *_parameters(f"parameters-{number}", other.extra.get("autopilot") or {}),
        ]
    return section("The vehicle", *parts)


def _parameters(id_: str, autopilot: Mapping[str, Any]) -> list[str]:
    """The parameters that the calibration sets: old and new values."""
    old, new = autopilot.get("params_old") or {}, autopilot.get("params_new") or {}
    if not new:
        return []
    rows = [[name, _value(old.get(name)), _value(value)] for name, value in new.items()]
    residual = as_float(autopilot.get("residual_mps2"))
    left = f" What they cannot represent leaves an error of {residual:.2g} m/s² rms." if math.isfinite(residual) else ""
    said = paragraph(
        f"An autopilot keeps offsets and scale factors only, and applies them itself.{left} "
        "They are set by mpucal write calibration.json autopilot.",
        note=True,
    )
    return [table(id_, f"parameters of {autopilot.get('firmware', 'the autopilot')}", ["", "old", "new"], rows), said]


def _value(value: Any) -> str:
    number = as_float(value)
    return f"{number:.6g}" if math.isfinite(number) else "unknown"
