"""How two calibrations differ, number by number, and whether that is more than their uncertainties."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from statistics import NormalDist

import numpy as np

from ..data import Vector
from . import error_model
from .calibration import GOOD, Calibration
from .error_model import AXES

# how sure "they differ" is: of two calibrations of one unchanged sensor, 1 in 100 are called different
CONFIDENCE = 0.99
# How much too sure a calibration with reservations may be: of one unchanged sensor, halves of a real recording with
# such a verdict were 1.1 times as far apart as two good ones may be, and worse recordings than that one there are.
RESERVED = 2.0
# K is symmetric to rounding where the calibration was made in the body frame
SYMMETRIC = 1e-6
WARMER_C = 3.0


@dataclass(frozen=True)
class Difference:
    """One number of B less that of A.

    Attributes
    ----------
    name, unit : of the number. value, std : of the difference; std NaN where a calibration does not say.
    """

    name: str
    unit: str
    value: float
    std: float

    @property
    def z(self) -> float:
        """In standard deviations; NaN where those are not known."""
        return self.value / self.std if self.std > 0.0 else math.nan


@dataclass(frozen=True)
class Comparison:
    """Two calibrations, A and B.

    Attributes
    ----------
    numbers : the accelerometer's twelve. gyroscope : its bias, which changes from day to day.
    remarks : what else differs, a sentence each.
    margin : by what factor the uncertainties may be too small: 1 for two good calibrations.
    """

    numbers: tuple[Difference, ...]
    gyroscope: tuple[Difference, ...]
    remarks: tuple[str, ...]
    margin: float = 1.0

    @property
    def limit(self) -> float:
        """Standard deviations beyond which one of the numbers differs: Šidák's, so that CONFIDENCE holds for all."""
        count = max(len(self._known), 1)
        return NormalDist().inv_cdf((1 + CONFIDENCE ** (1 / count)) / 2)

    @property
    def same(self) -> bool | None:
        """Whether they are one sensor's, unchanged, as far as they know.

        None where that cannot be told: no uncertainty is known, or something is doubtful.
        """
        if self.changed:
            return False
        return None if self.doubtful or not self._known else True

    @property
    def changed(self) -> tuple[Difference, ...]:
        """What differs by more than the uncertainties, even if they are too small; the surest first."""
        return self._beyond(self.limit * self.margin)

    @property
    def doubtful(self) -> tuple[Difference, ...]:
        """What else differs by more than the uncertainties, if these are to be relied on; the surest first."""
        return self._beyond(self.limit)[len(self.changed) :]

    def _beyond(self, limit: float) -> tuple[Difference, ...]:
        return tuple(sorted((d for d in self._known if abs(d.z) > limit), key=lambda d: -abs(d.z)))

    @property
    def _known(self) -> list[Difference]:
        return [d for d in self.numbers if math.isfinite(d.z)]


def compare(a: Calibration, b: Calibration) -> Comparison:
    """B less A, both in the body frame, with b_a(T) at A's temperature where B has it."""
    a, b = in_body_frame(a), in_body_frame(b)
    bias = b.b_a_at(a.sensor.temperature_c) - a.b_a_at(b.sensor.temperature_c if not b.follows_temperature else None)
    numbers = [
        *_row("bias", "mg", error_model.bias_mg(bias), error_model.bias_mg(np.hypot(a.b_a_std, b.b_a_std))),
        *_scale_factor_errors(a, b),
        *_misalignments(a, b),
    ]
    std = np.hypot(a.b_omega_std, b.b_omega_std)
    turned = _row("gyroscope's bias", "deg/s", np.degrees(b.b_omega - a.b_omega), np.degrees(std))
    margin = RESERVED if _reserved(a) or _reserved(b) else 1.0
    return Comparison(tuple(numbers), tuple(turned), tuple(_remarks(a, b)), margin)


def in_body_frame(c: Calibration) -> Calibration:
    """The same in the frame in which K is symmetric: with K = U S V^T, Q = V U^T takes K to Q K and D to D Q^T."""
    if not np.isfinite(c.K).all() or np.abs(c.K - c.K.T).max() < SYMMETRIC:
        return c
    U, _, Vt = np.linalg.svd(c.K)
    Q = Vt.T @ U.T
    # the deviations are those of a frame that is a degree away at most
    return replace(c, D=c.D @ Q.T, K=Q @ c.K)


def _row(name: str, unit: str, value: Vector, std: Vector) -> list[Difference]:
    return [Difference(f"{name} {axis}", unit, float(value[i]), float(std[i])) for i, axis in enumerate(AXES)]


def _scale_factor_errors(a: Calibration, b: Calibration) -> list[Difference]:
    value = error_model.scale_factor_error(b.D) - error_model.scale_factor_error(a.D)
    std = np.hypot(*(error_model.scale_factor_error_std(c.D_std) for c in (a, b)))
    return _row("scale factor error", "%", value, std)


def _misalignments(a: Calibration, b: Calibration) -> list[Difference]:
    value = error_model.misalignment(b.D) - error_model.misalignment(a.D)
    # an angle beyond a half turn is one the other way round
    value = (value + 180.0) % 360.0 - 180.0
    std = np.hypot(*(error_model.misalignment_std(c.D, c.D_std) for c in (a, b)))
    return [
        Difference(f"misalignment {AXES[i]}->{AXES[j]}", "deg", float(value[i, j]), float(std[i, j]))
        for i in range(3)
        for j in range(3)
        if i != j
    ]


def _remarks(a: Calibration, b: Calibration) -> list[str]:
    said = [_reservations(name, c) for name, c in (("A", a), ("B", b)) if _reserved(c)]
    if None not in (a.sensor.who_am_i, b.sensor.who_am_i) and a.sensor.who_am_i != b.sensor.who_am_i:
        said.append(
            f"They are of two chips: WHO_AM_I is 0x{a.sensor.who_am_i:02x} of A and 0x{b.sensor.who_am_i:02x} of B."
        )
    held = [c.sensor.accel_offsets for c in (a, b)]
    if None not in held and held[0] != held[1]:
        said.append(
            f"The offset registers held {held[0]} for A and {held[1]} for B: the biases differ by that, or it is"
            " another chip."
        )
    warm = [c.sensor.temperature_c for c in (a, b)]
    if warm[0] is not None and warm[1] is not None and abs(warm[1] - warm[0]) >= WARMER_C:
        said.append(
            f"A was measured at {warm[0]:.1f} °C and B at {warm[1]:.1f} °C: an MPU-6050's bias moves by some 0.5 mg a"
            " degree; `mpucal merge` makes b_a(T) of both."
        )
    gravity = [float(c.fit.get("gravity") or math.nan) for c in (a, b)]
    if abs(gravity[1] - gravity[0]) > 1e-6:
        said.append(
            f"A was fitted with a gravity of {gravity[0]:.5f} m/s² and B with {gravity[1]:.5f}: that alone makes"
            f" {100 * (gravity[1] / gravity[0] - 1):+.3f} % of scale factor."
        )
    old = [c.extra.get("autopilot", {}).get("params_old") for c in (a, b)]
    if old[0] != old[1]:
        said.append("They are of streams behind other parameters of the autopilot, or one is of no autopilot.")
    return said


def _reserved(c: Calibration) -> bool:
    """Whether its verdict has reservations; a blob has no verdict."""
    return c.verdict != GOOD and "verdict" in c.quality


def _reservations(name: str, c: Calibration) -> str:
    codes = ", ".join(str(reason["code"]) for reason in c.quality.get("reasons", ()))
    return (
        f"{name} is {c.verdict} ({codes}), and its uncertainties may be too small: a difference counts from"
        f" {RESERVED:g} times as much on."
    )
