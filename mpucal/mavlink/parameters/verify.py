"""Verify new parameters by what the streams of a vehicle that lies still make of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import permutations

import numpy as np

from ...data import STANDARD_GRAVITY_MPS2, Vector
from ...errors import WriteBackError
from ..rest_monitor import RestMeans
from .plan import Change

# a step of the stream, and what an attitude by the gyroscope is worse than one that did not change
AGREE_MPS2, SIGMAS, PER_TURN = 0.03, 3.0, 0.05
MOST_TURNED_RAD = 0.1


class SwappedSlotsError(WriteBackError):
    """The streams show that the parameters belong to each other's IMUs.

    Parameters
    ----------
    order : for each change, the index of the one in whose place its IMU's parameters are.
    """

    def __init__(self, order: tuple[int, ...]) -> None:
        super().__init__("the vehicle's IMUs are in another order than its parameters", "write again")
        self.order = order


def verify(planned: Sequence[Change], old: Mapping[str, float], before: RestMeans, after: RestMeans | None) -> None:
    """See in each stream what its new parameters must make of it.

    Parameters
    ----------
    old : what the vehicle held before, by name. before, after : how it rested then, and how it rests now.

    Raises
    ------
    SwappedSlotsError : every stream shows the new parameters of another IMU. WriteBackError : one shows something else.
    """
    if after is None:
        raise WriteBackError("the vehicle did not lie still while its new parameters were verified", "set it down")
    turned = before.attitude.T @ after.attitude
    angle = float(np.linalg.norm(turned - np.eye(3)) / np.sqrt(2))
    if angle > MOST_TURNED_RAD:
        raise WriteBackError(
            f"the vehicle was turned by {np.degrees(angle):.0f} deg while its new parameters were verified",
            "set it down, let go of it, and write again",
        )
    # by how much each IMU's stream (row) misses what each place's parameters (column) would make of it
    misses = np.array([[_miss(imu, at, old, before, after, turned, angle) for at in planned] for imu in planned])
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


def _miss(
    imu: Change,
    at: Change,
    old: Mapping[str, float],
    before: RestMeans,
    after: RestMeans,
    turned: Vector,
    angle: float,
) -> float:
    """By how much [m/s^2] the stream differs more than it may; not above 0 where it agrees, or shows nothing."""
    held = at.slot.correction(old)
    if held is None or not held.scale.all():
        return 0.0
    expected = at.slot.effective(held).recorrect(at.new, imu.mounting, before.mean[imu.stream])
    apart = np.abs(after.mean[imu.stream] - turned.T @ expected)
    noise = np.hypot(before.error[imu.stream], after.error[imu.stream])
    return float((apart - AGREE_MPS2 - SIGMAS * noise).max() - PER_TURN * angle * STANDARD_GRAVITY_MPS2)
