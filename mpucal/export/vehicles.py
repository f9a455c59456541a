"""A calibration as a vehicle's parameters: ArduPilot's in a .param file, PX4's in a .params file.

Mission Planner and MAVProxy load the former, QGroundControl the latter.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..mavlink.firmwares import PX4
from ..mavlink.parameters.encoding import parameters_text
from ..mavlink.parameters.plan import plan_changes, refused_imus
from ..result.calibration import Calibration
from .losses import date_text

UNNOTICED = "PX4 uses a new vector at once only if it differs by more than 0.01 from the old one; restart the vehicle."


def text(calibration: Calibration, notes: Sequence[str], firmware: str) -> str:
    """Return the text of a .param file for ArduPilot, or a .params file for PX4, with `notes` in its heading.

    It holds the new parameters of every IMU, and the ID of each sensor, without which a firmware treats the sensor as
    uncalibrated.

    Raises
    ------
    WriteBackError : the calibration is refused, not of a vehicle with this firmware, or beyond ArduPilot's limits.
    """
    changes = plan_changes(calibration, firmware)
    ids = {change.slot.sensor_id: change.sensor_id for change in changes if change.sensor_id}
    values = {name: value for change in changes for name, value in change.slot.values(change.new).items()} | ids
    imus = ", ".join(str(change.imu) for change in changes)
    about = f"Accelerometer calibration of a {firmware} vehicle by mpucal, {date_text(calibration)}: IMU {imus}"
    return parameters_text(firmware, values, (about, *notes), whole=ids)


def losses(calibration: Calibration, firmware: str) -> tuple[str, ...]:
    """Return notes on errors that remain with the parameters of a firmware; for errors raised see text."""
    changes = plan_changes(calibration, firmware)
    notes = [
        f"IMU {change.imu}: parameters have no cross-axis terms, which leaves errors of up to {change.residual}."
        for change in changes
    ]
    notes += [
        f"The vehicle did not report {change.slot.sensor_id}, without which {firmware} treats an accelerometer as"
        " uncalibrated: if it is 0, calibrate with the ground station once, and load the file after that."
        for change in changes
        if not change.sensor_id
    ]
    if refused := refused_imus(calibration):
        notes.append(f"IMU {', '.join(map(str, refused))} is not in the file: its calibration was refused.")
    return (*notes, UNNOTICED) if firmware == PX4 else tuple(notes)
