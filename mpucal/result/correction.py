"""A calibration applied to the samples of one source: of the same chip, and without removing a bias twice."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..data import Autopilot, Samples, Sensor
from ..errors import UsageError
from ..origin import Origin
from .calibration import Calibration

THIS_CHIP = "give the calibration of this chip"


@dataclass(frozen=True)
class Correction:
    """Correction of samples.

    Attributes
    ----------
    calibration : with `applied_in_hardware` as of these samples. remarks : sentences for the user.
    """

    calibration: Calibration
    remarks: tuple[str, ...] = ()

    def apply(self, samples: Samples) -> Samples:
        """Return the calibrated samples."""
        acc, gyr = self.calibration.apply(samples.acc, samples.gyr, samples.temperature_c)
        return replace(samples, acc=acc, gyr=gyr)


def make_correction(calibration: Calibration, sensor: Sensor, autopilot: Autopilot | None = None) -> Correction:
    """Return the correction of samples of `sensor`, which the parameters of `autopilot` have corrected already.

    Raises
    ------
    UsageError : the calibration was refused, or is of another chip or of other registers or parameters.
    """
    if calibration.objection:
        raise UsageError(calibration.objection, "calibrate again, and follow the remedies of its reasons")
    if not np.isfinite(calibration.K).all():
        raise UsageError("the calibration lacks K", "give one that has it")
    of = calibration.sensor
    if how := other_who_am_i(of.who_am_i, sensor.who_am_i):
        raise UsageError(f"the calibration is of another chip: {how}", THIS_CHIP)
    _check_origin(of, sensor)
    _check_parameters(calibration, autopilot)
    return _with_registers(calibration, sensor)


def other_who_am_i(calibrated: int | None, present: int | None) -> str:
    """Return a clause on the present chip's WHO_AM_I if it is not the calibrated one's; empty if it is, or unknown."""
    if None in (calibrated, present) or calibrated == present:
        return ""
    return f"WHO_AM_I of this chip is 0x{present:02x}, but 0x{calibrated:02x} of the calibrated one"


def same_trim(then: Sensor, now: Sensor) -> bool | None:
    """Return True if the offset registers of both held the same words; None if that is not known."""
    if then.accel_offsets is None or now.accel_offsets is None:
        return None
    # bit 0 of an offset register does nothing
    return all(a | 1 == b | 1 for a, b in zip(then.accel_offsets, now.accel_offsets, strict=True))


def _with_registers(calibration: Calibration, sensor: Sensor) -> Correction:
    """Return the correction that removes the bias once, even if a reset of the chip has restored its trim."""
    applied = calibration.applied_in_hardware
    same = same_trim(calibration.sensor, sensor)
    if same is None:
        remark = "It is assumed that the chip's offset registers still subtract the b_a that was written there."
        return Correction(calibration, (remark,) if np.any(applied) else ())
    if same and np.any(applied):
        remark = "The offset registers held the factory trim again: all of b_a is subtracted here."
        return Correction(replace(calibration, applied_in_hardware=np.zeros(3)), (remark,))
    if not same and not np.any(applied):
        raise UsageError(
            f"the offset registers held {sensor.accel_offsets} while these samples were taken, but"
            f" {calibration.sensor.accel_offsets} during the calibration",
            "give the calibration of this chip, or calibration-on-chip.json, which a write to its registers left",
        )
    return Correction(calibration)


def _check_origin(of: Sensor, sensor: Sensor) -> None:
    """Refuse a chip's calibration for samples that an autopilot rotated and corrected, and the other way round."""
    kinds = {Origin.CHIP: "a chip's own samples", Origin.VEHICLE: "an autopilot's stream"}
    if of.origin is not sensor.origin and {of.origin, sensor.origin} == kinds.keys():
        raise UsageError(
            f"the calibration is of {kinds[of.origin]}, but these are {kinds[sensor.origin]}",
            f"give the calibration of this {'chip' if sensor.origin is Origin.CHIP else 'vehicle'}",
        )


def _check_parameters(calibration: Calibration, autopilot: Autopilot | None) -> None:
    """Refuse a stream with other parameters than those of the calibrated stream."""
    of = calibration.extra.get("autopilot")
    if not of or autopilot is None:
        return
    old, now = of.get("params_old", {}), autopilot.parameters
    for name in of.get("params_new", {}):
        # a parameter is a float32 and passes through text
        if name in old and name in now and not np.isclose(old[name], now[name], rtol=1e-5, atol=1e-5):
            raise UsageError(
                f"{name} was {now[name]:g} while these samples were taken, but {old[name]:g} during the calibration",
                "give calibration-on-autopilot.json, which the write to the autopilot left",
            )
