"""What is known of the parameters before anything is fitted, as a normal density."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import Sensor, Vector
from ..rests.flat import Flat
from .parameters import BY_NAME, NAMES, PLACES, TABLE
from .theta import Theta, values


@dataclass(frozen=True)
class Prior:
    """The sum of precision (x - mean)^2 / 2, both (p,) in the order of NAMES; precision 0: nothing is known."""

    mean: Vector
    precision: Vector

    @classmethod
    def of(cls, **known: tuple[Vector | float, Vector | float]) -> Prior:
        """Of keys of PLACES (D row-major, K as its six), each (mean, standard deviation)."""
        mean, precision = np.zeros(len(NAMES)), np.zeros(len(NAMES))
        for name, (centre, sd) in known.items():
            mean[PLACES[name]], precision[PLACES[name]] = centre, 1.0 / np.square(sd)
        return cls(mean, precision)

    def cost(self, theta: Theta) -> float:
        """What it adds to V."""
        away = values(theta) - self.mean
        return 0.5 * float(self.precision @ (away * away))


def prior_of(flat: Flat, sensor: Sensor, **more: tuple[Vector | float, Vector | float]) -> Prior:
    """The table's priors, b_omega by the flat segment, and tau about what the sensor's filters are said to leave.

    more : of further rows, as Prior.of takes them.
    """
    known = {row.name: (np.array(row.mean), np.array(row.sd)) for row in TABLE if row.sd}
    known["tau"] = (np.array(sensor.accel_lag_s), np.array(BY_NAME["tau"].sd))
    return Prior.of(b_omega=(flat.b_omega, np.sqrt(flat.Sigma_omega / flat.n)), **known, **more)
