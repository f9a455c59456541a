"""`mpucal noise` on simulated noise of known coefficients: what is found against what is true, and its intervals.

python -m tools.lab noise_trials                        four kinds of axes, an hour at 100 Hz, 20 times
python -m tools.lab noise_trials --hours 3 --runs 100
"""

from __future__ import annotations

import argparse
import os
from functools import partial

import numpy as np
from rich.console import Console
from rich.table import Table

from mpucal.allan.model import NAMES, fitted
from mpucal.allan.octaves import Octaves
from mpucal.data import Vector
from mpucal.simulated.noise import noise

from .monte_carlo import in_parallel

RATE_HZ = 100.0
# white [units/sqrt(Hz)], bias instability [units], random walk [units/sqrt(s)]
AXES = {
    "accelerometer": (2.8e-3, 5e-4, 2e-5),
    "accelerometer, quiet": (1.0e-3, 2e-4, 1e-5),
    "gyroscope": (6e-5, 2e-5, 1e-6),
    "gyroscope, restless": (6e-5, 1e-5, 1e-5),
}


CONFIDENCES = (0.68, 0.95)


def of_seed(item: tuple[str, int], hours: float) -> Vector:
    """(5, 3): value, low and high by confidence, of white noise, bias instability and random walk, by the truth."""
    name, seed = item
    n = round(3600.0 * hours * RATE_HZ)
    samples = noise(np.random.default_rng([seed, *name.encode()]), n, RATE_HZ, *AXES[name])
    octaves = Octaves(1)
    for part in np.array_split(samples[:, None], max(n // 16384, 1)):
        octaves.add(part)
    sizes, variances, _ = octaves.variances()
    found = [fitted(sizes, variances[:, 0], n, 1.0 / RATE_HZ, confidence) for confidence in CONFIDENCES]
    ends = [end[:3] for one in found if one is not None for end in (one.low, one.high)]
    value = np.full(3, np.nan) if found[0] is None else found[0].value[:3]
    return np.array([value, *ends]) / np.array(AXES[name])


def main() -> None:
    """Simulate, fit, compare and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--runs", type=int, default=20, help="seeds of each axis")
    parser.add_argument("--seed", type=int, default=0, help="the first of the seeds")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes")
    options = parser.parse_args()
    items = [(name, options.seed + run) for name in AXES for run in range(options.runs)]
    found = list(in_parallel(partial(of_seed, hours=options.hours), items, options.jobs, "noise"))
    lines = Table("axis", "coefficient", "true", "found / true", "rms of it", "in 68 %", "in 95 %", "its end / true")
    for name, truth in AXES.items():
        of = np.array([one for (axis, _), one in zip(items, found, strict=True) if axis == name])
        for i in range(3):
            value, *ends = of[:, :, i].T
            inside = [f"{100.0 * np.mean((low <= 1.0) & (high >= 1.0)):.0f} %" for low, high in (ends[:2], ends[2:])]
            cells = (f"{np.mean(value):.3f}", f"{np.std(value):.3f}", *inside, f"{np.median(ends[-1]):.2f}")
            lines.add_row(name, NAMES[i].replace("_", " "), f"{truth[i]:g}", *cells)
    Console(width=130).print(lines)
