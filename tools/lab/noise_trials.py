"""`mpucal noise` on simulated noise of known coefficients: its errors, and how often its intervals hold the truth.

python -m tools.lab noise_trials                        four kinds of axes, an hour at 100 Hz, 20 times
python -m tools.lab noise_trials --hours 3 --seeds 100
"""

from collections.abc import Sequence
from functools import partial

import numpy as np

from mpucal.allan.model import fit_coefficients
from mpucal.allan.trace import Octaves
from mpucal.result.noise import INSTABILITY, WALK, WHITE

from .runner import Trial, each_seed
from .scenarios.noise import noise
from .table import Column, Row

RATE_HZ = 100.0
# white [units/sqrt(Hz)], bias instability [units], random walk [units/sqrt(s)]
AXES = {
    "accelerometer": (2.8e-3, 5e-4, 2e-5),
    "accelerometer, quiet": (1.0e-3, 2e-4, 1e-5),
    "gyroscope": (6e-5, 2e-5, 1e-6),
    "gyroscope, restless": (6e-5, 1e-5, 1e-5),
}
CONFIDENCES = (0.68, 0.95)


def of_seed(item: tuple[str, int], *, hours: float = 1.0) -> list[Row]:
    """Simulate an axis for so long, and find its coefficients.

    A row's `by_truth` is the value found, and the low and high end by confidence, in units of the truth.
    """
    axis, seed = item
    n = round(3600.0 * hours * RATE_HZ)
    samples = noise(np.random.default_rng([seed, *axis.encode()]), n, RATE_HZ, *AXES[axis])
    octaves = Octaves(1)
    for part in np.array_split(samples[None], max(n // 16384, 1), axis=1):
        octaves.add(part)
    sizes, variances, _ = octaves.variances()
    found = [fit_coefficients(sizes, variances[:, 0], n, 1.0 / RATE_HZ, confidence) for confidence in CONFIDENCES]
    ends = [end[:3] for one in found if one is not None for end in (one.low, one.high)]
    value = np.full(3, np.nan) if found[0] is None else found[0].value[:3]
    by_truth = (np.array([value, *ends]) / np.array(AXES[axis])).T.tolist()
    of_names = zip((WHITE, INSTABILITY, WALK), AXES[axis], by_truth, strict=True)
    return [Row(axis=axis, name=name, truth=truth, by_truth=found) for name, truth, found in of_names]


def inside(found: Sequence[Row], low: int) -> str:
    """Return how many intervals hold the truth."""
    return f"{100.0 * np.mean([one.by_truth[low] <= 1.0 <= one.by_truth[low + 1] for one in found]):.0f} %"


COLUMNS: dict[str, Column] = {
    "found / true": lambda found: f"{np.mean([one.by_truth[0] for one in found]):.3f}",
    "rms of it": lambda found: f"{np.std([one.by_truth[0] for one in found]):.3f}",
    "in 68 %": partial(inside, low=1),
    "in 95 %": partial(inside, low=3),
    "its end / true": lambda found: f"{np.median([one.by_truth[4] for one in found]):.2f}",
}

main = Trial(__doc__, of_seed, lambda seeds: each_seed(AXES, seeds), COLUMNS, by=("axis", "name", "truth"))
