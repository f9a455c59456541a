"""Bridges whose clocks are off: the errors of their rate, K and D, in units of what is claimed.

python -m tools.lab clock_trials --seeds 5000:5200     # -1 to +1 %, drifts of 50 ppm a minute, bursts of 1 to 16 ms
"""

from typing import Any

import numpy as np

import mpucal
from mpucal.bridge.bus import BridgeBus
from mpucal.chip.driver import Driver
from mpucal.session.events import Prompt, PromptKind
from mpucal.simulated.chip import open_simulated
from mpucal.simulated.chip.bus import FastClock

from .bridge import EmulatedBridge, EmulatedLine
from .judge import rms
from .runner import Trial
from .table import Row, known

SECONDS, FLAT_S, MS = 75.0, 12.0, 1_000_000


def recorded(seed: int, ppm: float, drift_ppm_a_minute: float, burst_ms: int) -> tuple[mpucal.Recording, Any]:
    """Return a recording of a hand that is told to lay the board flat, then to turn it; and the truth."""
    clock = FastClock()
    chip = open_simulated("sim:hand=random", seed=seed, clock=clock)

    def shown() -> int:
        t_s = clock.now() * 1e-9
        return clock.now() + round(ppm * 1e3 * t_s + 0.5e3 / 60 * drift_ppm_a_minute * t_s**2)

    driver = Driver(BridgeBus(EmulatedLine(EmulatedBridge(chip, shown), clock, burst_ns=burst_ms * MS)))
    driver.start()
    for kind, until_s in ((PromptKind.LAY_FLAT, FLAT_S), (PromptKind.ROTATE, SECONDS)):
        chip.hear(Prompt(kind, ""))
        while clock.now() < until_s * 1e9:
            driver.poll()
    return driver.recording(), chip.truth_document()


def of_seed(seed: int) -> Row:
    """Record behind a bridge that the seed draws, calibrate and compare: errors in their standard uncertainties."""
    rng = np.random.default_rng([seed, 7])
    ppm, drift, burst_ms = rng.uniform(-1e4, 1e4), float(rng.choice([-50, 0, 50])), int(rng.choice([1, 4, 16]))
    recording, truth = recorded(seed, ppm, drift, burst_ms)
    found, sensor = mpucal.calibrate(recording, gravity=truth["gravity"]), recording.sensor
    error = (sensor.clock_ppm or 0.0) - (ppm + drift * SECONDS / 120)
    std = (sensor.clock_std or np.nan) * 1e6
    return Row(
        words=f"{seed:4d}  {burst_ms:2d} ms {ppm:+7.0f} ppm: off by {error:+.2f} ({std:.2f}), {found.verdict}",
        ppm=error / std,
        K=tuple(np.diag((found.K - truth["K"]) / found.K_std).tolist()),
        D=tuple(((found.D - truth["D"]) / found.D_std).ravel().tolist()),
    )


def report(rows: list[Row]) -> None:
    """Print the rms of the errors."""
    print("rms z: " + ", ".join(f"{name} {rms(known(rows, name)):.2f}" for name in ("ppm", "K", "D")))


main = Trial(__doc__, of_seed, lambda seeds: seeds, report=report, line=lambda row: row.words)
