"""Sensors as a data sheet allows, or nearly perfect ones, where a recording hardly shows which.

Six sides determine offsets and scale factors as well as the angles between the axes are known: a side that is put down
askew shows a little of another axis. The angles follow from turns by the gyroscope, as well as its K is known. Data
sheets allow percents; simulators, and some makers of autopilots, deliver far less. Each kind is weighed by its evidence
for the estimate that was made without it, and the mean over the kinds is taken.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from ..data import Vector
from .fit import Fit
from .parameters import ACCELEROMETER, BY_NAME, PLACES
from .static import CROSS_AXIS_SD
from .theta import UPPER, from_elements
from .uncertainty import is_usable

# Deviation of the angles between two axes, [rad], and how likely it is beforehand: two cross-axis sensitivities, or too
# small to matter, as 1e-4 makes 1 mm/s^2 of |a|.
ANGLES = ((CROSS_AXIS_SD * 2**0.5, 0.9), (1e-4, 0.1))
# Variance of K that is known beside its prior, in the prior's own, and how likely it is beforehand: nothing is, or K is
# ten and a hundred times as near to the identity.
RATES = ((1e6, 0.8), (1e-2, 0.1), (1e-4, 0.1))
PAIRS = np.array([(0, 1), (0, 2), (1, 2)])


def weigh_perfect_sensors(fit: Fit, mounting: Vector) -> Fit:
    """Return the fit with the mean over the kinds of sensors, by their weights, and with its covariance.

    mounting : (3, 3) from the accelerometer's axes to those of the samples.
    """
    if PLACES["K"].stop > len(fit.names) or not is_usable(fit):
        return fit
    C, K_sd = fit.covariance, np.array(BY_NAME["K"].sd)
    away, J = _angles(fit, mounting)
    away = np.append(away, (fit.K - np.eye(3))[UPPER])
    J = np.vstack([J, np.eye(len(fit.names))[PLACES["K"]]])
    log_weights, steps, gains, precisions = [], [], [], []
    for (sd, likely), (more, as_likely) in product(ANGLES, RATES):
        # Sums of an angle's two elements are skew, differences a rotation of all axes, of which nobody knows.
        variance = np.concatenate([np.repeat(np.square([sd, ANGLES[0][0]]), len(PAIRS)), more * K_sd**2])
        precisions.append(1.0 / variance)
        S = J @ C @ J.T + np.diag(variance)
        gains.append(np.linalg.solve(S, J @ C))
        steps.append(-away @ gains[-1])
        # The estimate has K's prior already: its evidence is relative to that.
        relative = 0.5 * len(K_sd) * np.log1p(more) - 0.5 * np.linalg.slogdet(S)[1]
        log_weights.append(np.log(likely * as_likely) + relative - 0.5 * away @ np.linalg.solve(S, away))
    weight = np.exp(np.array(log_weights) - max(log_weights))
    weight /= weight.sum()
    step = weight @ np.array(steps)
    apart = np.array(steps) - step
    learned = np.einsum("k,kip,iq->pq", weight, np.array(gains), J @ C) - np.einsum("k,kp,kq->pq", weight, apart, apart)
    of_D, of_b_a = np.split(step[ACCELEROMETER], [9])
    parts = fit.parts
    if parts is not None:
        # What is now known of the sensor, the parts of the recording cannot have changed.
        parts = replace(parts, H=parts.H + J.T @ ((weight @ np.array(precisions))[:, None] * J))
    return replace(
        fit,
        D=fit.D + of_D.reshape(3, 3),
        b_a=fit.b_a + of_b_a,
        K=fit.K + from_elements(BY_NAME["K"].form, step[PLACES["K"]]),
        covariance=C - learned,
        parts=parts,
    )


def _angles(fit: Fit, mounting: Vector) -> tuple[Vector, Vector]:
    """Return (6,) sums and differences of cross-axis sensitivities in the sensor's axes, and derivatives (6, p)."""
    D = mounting.T @ fit.D @ mounting
    in_sensor_axes = np.kron(mounting.T, mounting.T).reshape(3, 3, 9)
    size = np.diag(D)[:, None]
    share = D / size
    by_D = in_sensor_axes / size[..., None] - (share / size)[..., None] * np.einsum("iik->ik", in_sensor_axes)[:, None]
    (i, j), J = PAIRS.T, np.zeros((2 * len(PAIRS), len(fit.names)))
    J[:, PLACES["D"]] = np.vstack([by_D[i, j] + by_D[j, i], by_D[i, j] - by_D[j, i]])
    return np.append(share[i, j] + share[j, i], share[i, j] - share[j, i]), J
