"""Verification of new parameters by the streams of a vehicle at rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import permutations

import numpy as np

from ...data import STANDARD_GRAVITY_MPS2, Vector
from ...errors import WriteBackError
from ..rest_monitor import RestMeans
from .plan import Change

# Tolerances: a step of the stream; standard deviations of the means; part of an attitude change by the gyroscope.
AGREE_MPS2, SIGMAS, PER_TURN = 0.03, 3.0, 0.05
MOST_TURNED_RAD = 0.1


class SwappedSlotsError(WriteBackError):
    """The streams show that the parameters act on one another's IMUs.

    Parameters
    ----------
    order : for each change, the index of the one whose slot acts on its IMU.
    """

    def __init__(self, order: tuple[int, ...]) -> None:
        super().__init__("the vehicle's IMUs are in another order than its parameters", "write again")
        self.order = order


def verify(
    planned: Sequence[Change], old: Mapping[str, float], before: RestMeans, after: RestMeans | None, turn: Vector
) -> None:
    """Check that each stream changed as its new parameters must change it.

    Parameters
    ----------
    old : the vehicle's parameters before the write, by name. before, after : its streams at rest then and now.
    turn : rotation (3, 3) of the streams by the new level.

    Raises
    ------
    SwappedSlotsError : every stream shows the new parameters of another IMU. WriteBackError : a stream shows neither.
    """
    if after is None:
        raise WriteBackError("the vehicle did not lie still while its new parameters were verified", "set it down")
    turned = before.attitude.T @ after.attitude
    angle = float(np.linalg.norm(turned - np.eye(3)) / np.sqrt(2))
    if angle > MOST_TURNED_RAD:
        raise WriteBackError(
            f"the vehicle was turned by {np.degrees(angle):.0f} deg while its new parameters were verified",
            "set it down, do not touch it, and write again",
        )

    def excess(imu: Change, at: Change) -> float:
        """Return by how much [m/s^2] the stream of `imu` misses the prediction of slot `at` beyond the tolerances."""
        held = at.slot.correction(old)
        if held is None or not held.scale.all():
            return 0.0
        expected = turn @ at.slot.effective(held).recorrect(at.new, imu.mounting, before.mean[imu.stream])
        apart: Vector = np.abs(after.mean[imu.stream] - turned.T @ expected)
        noise = np.hypot(before.error[imu.stream], after.error[imu.stream])
        return float((apart - AGREE_MPS2 - SIGMAS * noise).max() - PER_TURN * angle * STANDARD_GRAVITY_MPS2)

    # Rows: the IMUs' streams; columns: the slots.
    misses = np.array([[excess(imu, at) for at in planned] for imu in planned])
    indices = tuple(range(len(planned)))
    fitting = [order for order in permutations(indices) if all(misses[i, order[i]] <= 0 for i in indices)]
    if indices in fitting:
        return
    if len(fitting) == 1:
        raise SwappedSlotsError(fitting[0])
    worst = max(indices, key=lambda i: misses[i, i])
    raise WriteBackError(
        f"IMU {planned[worst].imu}'s stream does not show its new parameters, by {misses[worst, worst]:.3f} m/s^2 more"
        " than it may differ",
        "check that nobody else writes parameters, and how they say it is mounted, then calibrate again",
    )
