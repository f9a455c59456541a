"""A calibration as a vehicle's parameters: ArduPilot's in a .param file, PX4's in a .params file.

Mission Planner and MAVProxy load the former, QGroundControl the latter.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..mavlink.firmwares import ARDUPILOT, PX4
from ..mavlink.parameters.encoding import INT32, as_float32
from ..mavlink.parameters.plan import plan_changes, refused_imus
from ..mavlink.parameters.text import param_text, params_text
from ..result.calibration import Calibration
from .losses import date_text

UNNOTICED = "PX4 uses a new vector at once only if it differs by more than 0.01 from the old one; restart the vehicle."


def ardupilot(calibration: Calibration, notes: Sequence[str]) -> str:
    """Return a .param file's text, with `notes` in its heading.

    Raises
    ------
    WriteBackError : the calibration is refused, not of a vehicle with this firmware, or beyond ArduPilot's limits.
    """
    values = _values(calibration, ARDUPILOT) | _ids(calibration, ARDUPILOT)
    return param_text(values, (_head(calibration, ARDUPILOT), *notes))


def px4(calibration: Calibration, notes: Sequence[str]) -> str:
    """Return a .params file's text; see ardupilot."""
    ids = _ids(calibration, PX4)
    values = _values(calibration, PX4) | ids
    return params_text(values, (_head(calibration, PX4), *notes), types=dict.fromkeys(ids, INT32))


def _values(calibration: Calibration, firmware: str) -> dict[str, float]:
    """Return the new parameters of every IMU by name, rounded to float32."""
    held: dict[str, float] = {}
    for change in plan_changes(calibration, firmware):
        held |= {name: as_float32(value) for name, value in change.slot.values(change.new).items()}
    return held


def _ids(calibration: Calibration, firmware: str) -> dict[str, float]:
    """Return the IDs of the calibrated sensors by name; a firmware treats a sensor without its ID as uncalibrated."""
    of = {change.slot.sensor_id: change.sensor_id for change in plan_changes(calibration, firmware)}
    return {name: as_float32(value) for name, value in of.items() if value}


def _head(calibration: Calibration, firmware: str) -> str:
    imus = ", ".join(str(change.imu) for change in plan_changes(calibration, firmware))
    return f"Accelerometer calibration of a {firmware} vehicle by mpucal, {date_text(calibration)}: IMU {imus}"


def losses(calibration: Calibration, firmware: str) -> tuple[str, ...]:
    """Return notes on errors that remain with the parameters of a firmware; for errors raised see ardupilot."""
    notes = [
        f"IMU {change.imu}: parameters have no cross-axis terms, which leaves errors of up to {change.residual}."
        for change in plan_changes(calibration, firmware)
    ]
    named = _ids(calibration, firmware)
    notes += [
        f"The vehicle did not report {change.slot.sensor_id}, without which {firmware} treats an accelerometer as"
        " uncalibrated: if it is 0, calibrate with the ground station once, and load the file after that."
        for change in plan_changes(calibration, firmware)
        if change.slot.sensor_id not in named
    ]
    if refused := refused_imus(calibration):
        notes.append(f"IMU {', '.join(map(str, refused))} is not in the file: its calibration was refused.")
    return (*notes, UNNOTICED) if firmware == PX4 else tuple(notes)
