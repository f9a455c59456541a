"""Comparison of two calibrations: differences of their numbers, their significance, and which one is better."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from ..data import AXES, Vector
from . import error_model
from .calibration import GOOD, Calibration
from .correction import same_trim

# Of pairs of calibrations of an unchanged linear sensor, and of checks of an unchanged sensor, 1 in 100 find a change.
CONFIDENCE = 0.99
# Degrees of freedom of the standard uncertainties of the model `hand`, which come from a few turns between rests.
FREEDOM_OF_A_HAND = 12.0
# Factor by which the uncertainties of a calibration with reservations may be too small. Halves of a real recording with
# this verdict, of an unchanged sensor, were 1.1 times as far apart as two good ones may be, and there are worse ones.
RESERVED = 2.0
# two temperatures that are nearer may be one: a thermometer errs by as much, and a chip warms unevenly
TOLD_APART_C = 2.0
# change of the bias with the temperature, by the data sheet of the chip or of the one that it is like
BIAS_MG_PER_C = {"MPU-6050": 0.5, "MPU-6500": 1.0}
# a covariance covers chance alone: a smaller improvement does not count
LEAST_STD_MPS2 = 0.001


@dataclass(frozen=True)
class Difference:
    """Difference of one number, B minus A.

    Attributes
    ----------
    name, unit : of the number. value, std : of the difference; std is NaN if a calibration lacks it.
    """

    name: str
    unit: str
    value: float
    std: float

    @property
    def z(self) -> float:
        """Return the difference in standard deviations; NaN if these are not known."""
        return self.value / self.std if self.std > 0.0 else math.nan


@dataclass(frozen=True)
class Comparison:
    """Comparison of two calibrations, A and B.

    Attributes
    ----------
    numbers : the accelerometer's twelve. gyroscope : its bias, which changes from day to day.
    remarks : sentences on other differences.
    margin : factor by which the uncertainties may be too small: 1 for two good calibrations.
    freedom : degrees of freedom of the uncertainties.
    """

    numbers: tuple[Difference, ...]
    gyroscope: tuple[Difference, ...]
    remarks: tuple[str, ...]
    margin: float = 1.0
    freedom: float = math.inf

    @property
    def limit(self) -> float:
        """Return the limit of |z| of one number."""
        return limit_of(max(len(self._known), 1), self.freedom)

    @property
    def same(self) -> bool | None:
        """Return True if they agree with one unchanged sensor, False if not.

        None if this cannot be decided: no uncertainty is known, or a difference is doubtful.
        """
        if self.changed:
            return False
        return None if self.doubtful or not self._known else True

    @property
    def changed(self) -> tuple[Difference, ...]:
        """Return differences that are significant even with uncertainties `margin` times larger; largest |z| first."""
        return self._beyond(self.limit * self.margin)

    @property
    def doubtful(self) -> tuple[Difference, ...]:
        """Return further differences that are significant only if the uncertainties are right; largest |z| first."""
        return self._beyond(self.limit)[len(self.changed) :]

    def _beyond(self, limit: float) -> tuple[Difference, ...]:
        return tuple(sorted((d for d in self._known if abs(d.z) > limit), key=lambda d: -abs(d.z)))

    @property
    def _known(self) -> list[Difference]:
        return [d for d in self.numbers if math.isfinite(d.z)]


def compare(a: Calibration, b: Calibration) -> Comparison:
    """Compare B with A, both in the body frame, with b_a(T) of B at A's temperature if B has it."""
    a, b = in_body_frame(a), in_body_frame(b)
    if _has_own_axes(a) or _has_own_axes(b):
        a, b = (replace(c, D=error_model.sensor_axes(c.D)) for c in (a, b))
    bias = b.b_a_at(a.sensor.temperature_c) - a.b_a_at(b.sensor.temperature_c if not b.follows_temperature else None)
    deviation = error_model.bias_mg(np.hypot(a.b_a_std, b.b_a_std))
    numbers = [*_row("bias", "mg", error_model.bias_mg(bias), deviation), *_of_matrix(a, b)]
    std = np.hypot(a.b_omega_std, b.b_omega_std)
    gyroscope = _row("gyroscope's bias", "deg/s", np.degrees(b.b_omega - a.b_omega), np.degrees(std))
    margin = RESERVED if _has_reservations(a) or _has_reservations(b) else 1.0
    freedom = degrees_of_freedom(a.fit.get("model"), b.fit.get("model"))
    return Comparison(tuple(numbers), tuple(gyroscope), tuple(_remarks(a, b)), margin, freedom)


def degrees_of_freedom(*models: str | None) -> float:
    """Return the degrees of freedom of the uncertainties of calibrations by these models."""
    return FREEDOM_OF_A_HAND if "hand" in models else math.inf


def like_chip(chip: str | None) -> str:
    """Return the chip, of those in BIAS_MG_PER_C, whose bias changes with the temperature as that of `chip` does."""
    return "MPU-6050" if "6050" in (chip or "6050") else "MPU-6500"


def limit_of(count: int, freedom: float = math.inf) -> float:
    """Return the limit of |z| of each of this many numbers, by Šidák's correction, so that CONFIDENCE holds for all.

    freedom : degrees of freedom of the standard deviations, for Student's t.
    """
    from scipy.special import stdtrit  # noqa: PLC0415 - slow to import

    return float(stdtrit(freedom, (1 + CONFIDENCE ** (1 / count)) / 2))


def in_body_frame(c: Calibration) -> Calibration:
    """Return the calibration in the frame where K is symmetric."""
    if not np.isfinite(c.K).all():
        return c
    D, K, _ = error_model.to_body_frame(c.D, c.K)
    # the standard deviations are kept, since the frames are a degree apart at most
    return replace(c, D=D, K=K)


def _row(name: str, unit: str, value: Vector, std: Vector) -> list[Difference]:
    return [Difference(f"{name} {axis}", unit, float(value[i]), float(std[i])) for i, axis in enumerate(AXES)]


def _of_matrix(a: Calibration, b: Calibration) -> list[Difference]:
    """Return the differences of the scale factor errors and of the misalignments."""
    value = error_model.scale_factor_error(b.D) - error_model.scale_factor_error(a.D)
    std = np.hypot(*(error_model.scale_factor_error_std(c.D_std) for c in (a, b)))
    # an angle beyond half a turn is one in the other direction
    angle = (error_model.misalignment(b.D) - error_model.misalignment(a.D) + 180.0) % 360.0 - 180.0
    angle_std = np.hypot(*(error_model.misalignment_std(c.D, c.D_std) for c in (a, b)))
    return _row("scale factor error", "%", value, std) + [
        Difference(f"misalignment {AXES[i]}->{AXES[j]}", "deg", float(angle[i, j]), float(angle_std[i, j]))
        for i, j in permutations(range(3), 2)
    ]


def _remarks(a: Calibration, b: Calibration) -> list[str]:
    remarks = [_reservations(name, c) for name, c in (("A", a), ("B", b)) if _has_reservations(c)]
    if _has_own_axes(a) or _has_own_axes(b):
        remarks.append(
            "The model static determines no rotation against the gyroscope: both are compared in the accelerometer's"
            " own axes."
        )
    two_chips = None not in (a.sensor.who_am_i, b.sensor.who_am_i) and a.sensor.who_am_i != b.sensor.who_am_i
    if two_chips:
        remarks.append(
            f"They are of two chips: WHO_AM_I of A is 0x{a.sensor.who_am_i:02x}, of B 0x{b.sensor.who_am_i:02x}."
        )
    other_trim = same_trim(a.sensor, b.sensor) is False
    if other_trim:
        remarks.append(
            f"The offset registers held {a.sensor.accel_offsets} for A and {b.sensor.accel_offsets} for B: the biases"
            " differ by that, or these are two chips."
        )
    warm = [c.sensor.temperature_c for c in (a, b)]
    if warm[0] is not None and warm[1] is not None and abs(warm[1] - warm[0]) >= TOLD_APART_C:
        like = like_chip(a.sensor.chip)
        remarks.append(
            f"A was measured at {warm[0]:.1f} °C and B at {warm[1]:.1f} °C: the bias of an {like} changes by about"
            f" {BIAS_MG_PER_C[like]:g} mg per degree"
            f"{'' if two_chips or other_trim else '; `mpucal merge` makes b_a(T) from both'}."
        )
    gravity = [float(c.fit.get("gravity") or math.nan) for c in (a, b)]
    if abs(gravity[1] - gravity[0]) > 1e-6:
        remarks.append(
            f"A was made with a gravity of {gravity[0]:.5f} m/s² and B with {gravity[1]:.5f}: that alone changes the"
            f" scale factors by {100 * (gravity[1] / gravity[0] - 1):+.3f} %."
        )
    old = [c.extra.get("autopilot", {}).get("params_old") for c in (a, b)]
    if old[0] != old[1]:
        remarks.append(
            "They are of streams with different parameters of the autopilot, or only one is of an autopilot."
        )
    return remarks


def _has_own_axes(c: Calibration) -> bool:
    """Return True if D was estimated without the gyroscope, so that no mount is known."""
    return c.fit.get("model") == "static"


def _has_reservations(c: Calibration) -> bool:
    """Return True if the verdict has reservations; a blob has no verdict."""
    return c.verdict != GOOD and "verdict" in c.quality


def _reservations(name: str, c: Calibration) -> str:
    codes = ", ".join(str(reason["code"]) for reason in c.quality.get("reasons", ()))
    return (
        f"{name} is {c.verdict} ({codes}), and its uncertainties may be too small: only differences of"
        f" {RESERVED:g} times the usual limit count."
    )


def is_better(new_mps2: float, old_mps2: float, std_mps2: float) -> bool:
    """Return True if |a| is predicted to be nearer to g with the new correction.

    Parameters
    ----------
    new_mps2, old_mps2 : largest error of |a| with each correction, if the calibration were exact.
    std_mps2 : standard uncertainty of the calibration. It is part of both errors: the square of the old one is too
        large by its square, and that of the new one too small.
    """
    std_mps2 = max(std_mps2, LEAST_STD_MPS2)
    return old_mps2**2 - std_mps2**2 > new_mps2**2 + std_mps2**2


def worst_magnitude_error(true: Calibration, D: Vector, b_a: Vector) -> float:
    """Return the largest error of |a| [m/s^2] over all attitudes if D, b_a correct a sensor that `true` describes.

    a = inv(D) (D_true s + b_true - b_a): the singular values of inv(D) D_true bound the effect of the scale on |a|.
    """
    gravity = true.gravity
    singular = np.linalg.svd(np.linalg.solve(D, true.D), compute_uv=False)
    bias = np.linalg.norm(np.linalg.solve(D, true.b_a - b_a))
    return float(gravity * np.abs(singular - 1.0).max() + (bias if math.isfinite(bias) else math.inf))
