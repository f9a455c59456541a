"""What is known of the parameters before anything is measured, as a normal density."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import Vector
from .flat_segment import Flat
from .parameters import NAMES, PLACES
from .theta import Theta, values


@dataclass(frozen=True)
class Prior:
    """What is known beforehand: sum of precision (x - mean)^2 / 2, (27,) in the order of NAMES; precision 0: nothing.

    The tilts have no prior.
    """

    mean: Vector
    precision: Vector

    @classmethod
    def of(cls, **known: tuple[Vector | float, Vector | float]) -> Prior:
        """Of keys of PLACES (D row-major, K as its six), each (mean, standard deviation)."""
        mean, precision = np.zeros(len(NAMES)), np.zeros(len(NAMES))
        for name, (centre, sd) in known.items():
            place = slice(*PLACES[name])
            mean[place], precision[place] = centre, 1.0 / np.square(sd)
        return cls(mean, precision)

    def cost(self, theta: Theta) -> float:
        """What it adds to V."""
        away = values(theta) - self.mean
        return 0.5 * float(self.precision @ (away * away))


LEVER_SD_M = 0.3

DELAY_SD_S = 0.002


def prior_of(flat: Flat, **more: tuple[Vector | float, Vector | float]) -> Prior:
    """What is known beforehand: b_omega by the flat segment, K by a data sheet, tau and r by chips and hands.

    more : of further parameters, as Prior.of takes them.
    """
    return Prior.of(
        b_omega=(flat.b_omega, np.sqrt(flat.Sigma_omega / flat.n)),
        K=(K_MEAN, K_SD),
        tau=(0.0, DELAY_SD_S),
        r=(0.0, LEVER_SD_M),
        **more,
    )


# What a data sheet promises: +-3 % of scale, +-2 % across axes, taken as uniform; K is the symmetric part.
K_MEAN = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 1.0])

K_SD = np.array([0.02, 0.01, 0.01, 0.02, 0.01, 0.02])
