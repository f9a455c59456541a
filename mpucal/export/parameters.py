"""What both firmwares' parameter files hold of a calibration. Knows no file's form."""

from __future__ import annotations

from ..mavlink.parameters.encoding import as_float32
from ..mavlink.parameters.plan import changes, left_out
from ..result.calibration import Calibration


def values(calibration: Calibration, firmware: str) -> dict[str, float]:
    """The new parameters of every IMU by name, as a float32 holds them.

    Raises
    ------
    WriteBackError : see plan.changes.
    """
    held: dict[str, float] = {}
    for change in changes(calibration, firmware):
        held |= {name: as_float32(value) for name, value in change.place.values(change.new).items()}
    return held


def remarks(calibration: Calibration, firmware: str) -> tuple[str, ...]:
    """Lines for the head of the file."""
    imus = ", ".join(str(change.imu) for change in changes(calibration, firmware))
    made = (
        f"Accelerometer calibration of a {firmware} vehicle by mpucal, {calibration.created or 'undated'}: IMU {imus}"
    )
    return (made, *notes(calibration, firmware))


def notes(calibration: Calibration, firmware: str) -> tuple[str, ...]:
    """What the parameters do not hold."""
    said = [
        f"IMU {change.imu}: parameters hold no cross-axis terms; |a| stays wrong by up to"
        f" {change.residual_mps2:.3f} m/s^2."
        for change in changes(calibration, firmware)
    ]
    out = left_out(calibration)
    if out:
        said.append(f"IMU {', '.join(map(str, out))} is not in the file: its calibration was refused.")
    return tuple(said)
