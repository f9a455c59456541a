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
from .losses import dated

UNNOTICED = "PX4 takes a vector over at once only where it differs by more than 0.01 from the one in use; restart it."


def ardupilot(calibration: Calibration, notes: Sequence[str]) -> str:
    """A .param file's text, with `notes` in its head.

    Raises
    ------
    WriteBackError : a calibration that is refused, of no vehicle or of another firmware, or beyond ArduPilot's limits.
    """
    values = _values(calibration, ARDUPILOT) | _ids(calibration, ARDUPILOT)
    return param_text(values, (_head(calibration, ARDUPILOT), *notes))


def px4(calibration: Calibration, notes: Sequence[str]) -> str:
    """A .params file's text; see ardupilot."""
    ids = _ids(calibration, PX4)
    values = _values(calibration, PX4) | ids
    return params_text(values, (_head(calibration, PX4), *notes), types=dict.fromkeys(ids, INT32))


def left_by_ardupilot(calibration: Calibration) -> tuple[str, ...]:
    """What ArduPilot's parameters do not hold; see ardupilot for what it raises."""
    return _left_by(calibration, ARDUPILOT)


def left_by_px4(calibration: Calibration) -> tuple[str, ...]:
    """What PX4's parameters do not hold."""
    return (*_left_by(calibration, PX4), UNNOTICED)


def _values(calibration: Calibration, firmware: str) -> dict[str, float]:
    """The new parameters of every IMU by name, as a float32 holds them."""
    held: dict[str, float] = {}
    for change in plan_changes(calibration, firmware):
        held |= {name: as_float32(value) for name, value in change.slot.values(change.new).items()}
    return held


def _ids(calibration: Calibration, firmware: str) -> dict[str, float]:
    """The IDs of the sensors that were calibrated, by name; a firmware takes one without its ID for uncalibrated."""
    of = {change.slot.sensor_id: change.sensor_id for change in plan_changes(calibration, firmware)}
    return {name: as_float32(value) for name, value in of.items() if value}


def _head(calibration: Calibration, firmware: str) -> str:
    imus = ", ".join(str(change.imu) for change in plan_changes(calibration, firmware))
    return f"Accelerometer calibration of a {firmware} vehicle by mpucal, {dated(calibration)}: IMU {imus}"


def _left_by(calibration: Calibration, firmware: str) -> tuple[str, ...]:
    said = [
        f"IMU {change.imu}: parameters hold no cross-axis terms; |a| stays wrong by up to"
        f" {change.residual_mps2:.3f} m/s^2."
        for change in plan_changes(calibration, firmware)
    ]
    named = _ids(calibration, firmware)
    said += [
        f"The vehicle did not say what {change.slot.sensor_id} is, and {firmware} takes an accelerometer without it"
        " for uncalibrated: where it is 0, calibrate with the ground station once, and load the file then."
        for change in plan_changes(calibration, firmware)
        if change.slot.sensor_id not in named
    ]
    out = refused_imus(calibration)
    if out:
        said.append(f"IMU {', '.join(map(str, out))} is not in the file: its calibration was refused.")
    return tuple(said)
