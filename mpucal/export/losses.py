"""What a form leaves out of a calibration, in sentences with the error that this leaves."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

from ..data import STANDARD_GRAVITY_MPS2, Vector
from ..errors import RefusedError
from ..result.calibration import REFUSED, Calibration

# of a calibration: what a form cannot carry of it, a sentence each
Loss = Callable[[Calibration], tuple[str, ...]]

# what may end a comment or a string in one of the forms' languages
NOT_HARMLESS = re.compile(r"[^A-Za-z0-9_ .,:+()-]")

FLOAT_EPS = float(np.finfo(np.float32).eps)


def check_usable(calibration: Calibration) -> None:
    """Before anything is made of it.

    Raises
    ------
    RefusedError : it was refused, holds unknown numbers, or a D that cannot be inverted.
    """
    if calibration.quality.get("verdict") == REFUSED:
        raise RefusedError("nothing was exported: the calibration was refused", "measure again, as its reasons say")
    known = np.isfinite(calibration.D).all() and np.isfinite(calibration.b_a).all()
    if not known or np.linalg.matrix_rank(calibration.D) < 3:
        raise RefusedError("nothing was exported: D or b_a is not known, or D has no inverse", "measure again")


def head(calibration: Calibration) -> str:
    """What the file is, on one line."""
    of = harmless(calibration.sensor.chip or "a sensor")
    return f"Calibration of {of} by mpucal, {dated(calibration)}; m/s^2"


def dated(calibration: Calibration) -> str:
    """When it was made, for a remark."""
    return harmless(calibration.created) or "undated"


def harmless(text: str) -> str:
    """A name or a date as a remark may hold it in any language: on one line, and only a remark."""
    return NOT_HARMLESS.sub("_", text)


def in_float(calibration: Calibration) -> tuple[str, ...]:
    """Of a form whose numbers are float32."""
    return (f"Its numbers are float32: rounding leaves up to {float_error_mps2(calibration):.1g} m/s^2.",)


def float_error_mps2(calibration: Calibration) -> float:
    """Of some ten roundings at full scale [m/s^2]."""
    range_mps2 = (calibration.sensor.accel_range_g or 16.0) * STANDARD_GRAVITY_MPS2
    gain = float(np.abs(calibration.inverse).sum(axis=1).max())
    return 8 * FLOAT_EPS * gain * (range_mps2 + float(np.abs(calibration.b_a).max()))


def without_gyroscope(calibration: Calibration) -> tuple[str, ...]:
    """Of a form that corrects the accelerometer alone."""
    known = np.isfinite(calibration.b_omega).all()
    bias = f"{np.degrees(np.abs(calibration.b_omega).max()):.2f} deg/s" if known else "its bias"
    scale = 100.0 * float(np.abs(calibration.K - np.eye(3)).max())
    scaled = f" and up to {scale:.2f} % of a rate" if scale else ""
    return (f"It does not correct the gyroscope: {bias}{scaled} stay.",)


def without_temperature(calibration: Calibration) -> tuple[str, ...]:
    """Of a form that holds b_a at one temperature."""
    if not calibration.follows_temperature:
        return ()
    worst = float(np.abs(calibration.b_a_slope).max())
    at = calibration.sensor.temperature_c
    return (f"It holds b_a at {at:.1f} deg C: each degree away from that leaves up to {worst:.2g} m/s^2.",)


def where_temperature_is_not_given(calibration: Calibration) -> tuple[str, ...]:
    """Of a form that follows the temperature where it is told it."""
    if not calibration.follows_temperature:
        return ()
    return (f"Where it is not given the temperature: {without_temperature(calibration)[0]}",)


def with_hardware(calibration: Calibration) -> tuple[str, ...]:
    """Of a calibration whose bias the chip's registers subtract in part."""
    applied = calibration.applied_in_hardware
    if not np.any(applied):
        return ()
    return (
        f"It leaves out the ({mps2(applied)}) m/s^2 that the chip's offset registers subtract already; after a reset of"
        " the chip they do not, and as much error is left.",
    )


def mps2(values: Vector) -> str:
    """(3,) as words."""
    return ", ".join(f"{value:+.4f}" for value in values)
