"""A calibration made ready for the samples of one source: of the same chip, and no bias removed twice."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..data import Autopilot, Samples, Sensor
from ..errors import UsageError
from .calibration import REFUSED, Calibration

# an offset register's bit 0 does nothing
RESERVED = 1
# a parameter is a float32, and passes through text
SAME = 1e-5


@dataclass(frozen=True)
class Correction:
    """What to do to samples.

    Attributes
    ----------
    calibration : with `applied_in_hardware` as it was while these samples were taken.
    remarks : what a person should know of it, a sentence each.
    """

    calibration: Calibration
    remarks: tuple[str, ...] = ()

    def apply(self, samples: Samples) -> Samples:
        """The same samples, calibrated."""
        acc, gyr = self.calibration.apply(samples.acc, samples.gyr, samples.temperature_c)
        return replace(samples, acc=acc, gyr=gyr)


def correction(calibration: Calibration, sensor: Sensor, autopilot: Autopilot | None = None) -> Correction:
    """The correction of what `sensor` delivers, behind the parameters of `autopilot`.

    Raises
    ------
    UsageError : the calibration was refused, is of another chip, or is of it with other registers or parameters.
    """
    if calibration.quality.get("verdict") == REFUSED:
        raise UsageError("the calibration was refused", "measure again, as its reasons say")
    if not all(np.isfinite(array).all() for array in (calibration.D, calibration.b_a, calibration.K)):
        raise UsageError("the calibration holds no D, b_a or K", "give one that does")
    of = calibration.sensor
    if None not in (of.who_am_i, sensor.who_am_i) and of.who_am_i != sensor.who_am_i:
        raise UsageError(
            f"the calibration is of a chip that answers 0x{of.who_am_i:02x} to WHO_AM_I, and this one answers"
            f" 0x{sensor.who_am_i:02x}",
            "give the calibration of this chip",
        )
    _check_source(calibration, sensor, autopilot)
    _check_parameters(calibration, autopilot)
    return _with_registers(calibration, sensor)


def _with_registers(calibration: Calibration, sensor: Sensor) -> Correction:
    """Never is a bias removed twice, nor left where a reset of the chip brought it back."""
    applied = calibration.applied_in_hardware
    calibrated, now = calibration.sensor.accel_offsets, sensor.accel_offsets
    if calibrated is None or now is None:
        said = "the chip's offset registers are taken to subtract what they did when it was written there."
        return Correction(calibration, (f"Of b_a, {said}",) if np.any(applied) else ())
    same = all((a ^ b) & ~RESERVED == 0 for a, b in zip(calibrated, now, strict=True))
    if same and np.any(applied):
        remark = "The offset registers held the factory's trim again: all of b_a is subtracted here."
        return Correction(replace(calibration, applied_in_hardware=np.zeros(3)), (remark,))
    if not same and not np.any(applied):
        raise UsageError(
            f"the offset registers held {now} while these samples were taken, and {calibrated} when it was calibrated",
            "give the calibration of this chip, or calibration-on-chip.json, which a write into its registers left",
        )
    return Correction(calibration)


def _check_source(calibration: Calibration, sensor: Sensor, autopilot: Autopilot | None) -> None:
    """A chip's own samples, or those that an autopilot has turned and corrected: never the one for the other."""
    if autopilot is not None and calibration.sensor.who_am_i is not None:
        raise UsageError(
            f"the calibration is of a chip's own samples, and these came through {autopilot.firmware}",
            "give the calibration of this vehicle",
        )
    if calibration.extra.get("autopilot") and sensor.who_am_i is not None:
        raise UsageError(
            "the calibration is of an autopilot's stream, and these are a chip's own samples",
            "give the calibration of this chip",
        )


def _check_parameters(calibration: Calibration, autopilot: Autopilot | None) -> None:
    """The parameters that shaped the stream are those that shaped the calibrated one."""
    of = calibration.extra.get("autopilot")
    if not of or autopilot is None:
        return
    old, now = of.get("params_old", {}), autopilot.parameters
    for name in of.get("params_new", {}):
        if name in old and name in now and not np.isclose(old[name], now[name], rtol=SAME, atol=SAME):
            raise UsageError(
                f"{name} was {now[name]:g} while these samples were taken, and {old[name]:g} when it was calibrated",
                "give the calibration that the write to the autopilot left, calibration-on-autopilot.json",
            )
