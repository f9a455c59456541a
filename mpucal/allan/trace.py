"""The slow course of a long rest, in constant memory: means over blocks that double in length, and steps in them."""

from __future__ import annotations

import math

import numpy as np

from ..data import Vector

BLOCKS = 2048
FIRST_S = 0.5
# blocks averaged on each side of a step, and robust standard deviations that it exceeds
BESIDE, STEP_STD = 8, 10.0
LEAST_BLOCKS = 64
# more than drift or noise: a change of direction of gravity, and a rate
TURNED_RAD, TURNED_RAD_S = math.radians(2.0), math.radians(3.0)


class Trace:
    """Means of columns over blocks of `seconds`; blocks are merged in pairs to limit their number."""

    def __init__(self, columns: int, rate_hz: float) -> None:
        self._size = max(round(FIRST_S * rate_hz), 1)
        self._rate_hz = rate_hz
        self._means: list[Vector] = []
        self._held = np.zeros((0, columns))

    def add(self, values: Vector) -> None:
        """Add (n, columns) samples."""
        self._held = np.concatenate([self._held, values])
        whole = len(self._held) // self._size
        if not whole:
            return
        used = whole * self._size
        self._means += list(self._held[:used].reshape(whole, self._size, -1).mean(1))
        self._held = self._held[used:]
        while len(self._means) >= BLOCKS:
            # an odd last block is dropped
            pairs = np.array(self._means[: len(self._means) // 2 * 2]).reshape(-1, 2, self._held.shape[1])
            self._means = list(pairs.mean(1))
            self._size *= 2

    @property
    def seconds(self) -> float:
        """Return the duration of a block [s]."""
        return self._size / self._rate_hz

    @property
    def means(self) -> Vector:
        """Return the means (k, columns)."""
        return np.array(self._means).reshape(-1, self._held.shape[1])


def find_steps(means: Vector) -> list[tuple[int, int, float]]:
    """Return (block, column, size) of the largest significant step of each column of means (k, columns)."""
    if len(means) < LEAST_BLOCKS:
        return []
    total = np.concatenate([np.zeros((1, means.shape[1])), np.cumsum(means - means[0], axis=0)])
    of = (total[BESIDE:] - total[:-BESIDE]) / BESIDE
    jumps = of[BESIDE:] - of[:-BESIDE]
    spread = 1.4826 * np.median(np.abs(jumps - np.median(jumps, axis=0)), axis=0)
    found = []
    for column, (jump, std) in enumerate(zip(jumps.T, spread, strict=True)):
        at = int(np.abs(jump).argmax())
        if std > 0.0 and abs(jump[at]) > STEP_STD * std:
            found.append((at + BESIDE, column, float(jump[at])))
    return found


def find_turn(means: Vector) -> tuple[int, float] | None:
    """Return the first moving block of means (k, 6) and the largest turn of gravity [rad]; None if it lay still."""
    acc, rate = means[:, :3], np.linalg.norm(means[:, 3:6] - np.median(means[:, 3:6], axis=0), axis=1)
    away = np.arctan2(np.linalg.norm(np.cross(acc, acc[0]), axis=1), acc @ acc[0])
    moved = np.flatnonzero((away > TURNED_RAD) | (rate > TURNED_RAD_S))
    return (int(moved[0]), float(away.max())) if len(moved) else None
