"""`mpucal stream --watch` over hours of simulated use: false warnings, and the time until a change is reported.

python -m tools.lab watch_trials --only nothing --seeds 20 --hours 1       false warnings
python -m tools.lab watch_trials --seeds 40 --hours 0.5                    time until a bias step is reported

Each minute a hand takes an MPU-6050 from a table, holds it in six or eight orientations, turns it without a pause, or
turns it while it walks, and puts it down again; it trembles all the while. The calibration is one by twelve poses five
days before, as in tools/lab/check_trials.py, and the mounting bends in each rest by as much as there.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Annotated

import numpy as np

from mpucal.calibration.verification import FLOOR_MPS2
from mpucal.data import Recording
from mpucal.recheck.watch import DriftMonitor
from mpucal.simulated.sensor import SensorTruth

from .check_trials import DAYS, TEMPERATURE_C, at, calibrated_and_aged, events, happened
from .runner import Trial, names_of
from .scenarios.recordings import hand_scenario
from .table import Column, Row, count

RATE_HZ = 100.0
USES = ("pose7", "pose9", "continuous", "wobble30")
WATCHED = ("nothing", "bias 5 mg", "bias 10 mg", "bias 20 mg")
PART_S = 5.0
# a mounting bends anew about as often as the hand takes another orientation
GIVES_S = 7.0


def of_use(item: tuple[str, int], *, hours: Annotated[float, "of use, of each sensor"] = 0.5) -> Row | None:
    """Watch one sensor, and return the sensors of the warnings with their times [s]; None if it was refused."""
    event, seed = item
    if (begun := calibrated_and_aged(seed)) is None:
        return None
    calibration, aged, of_event, of_errors = begun
    after, _ = happened(aged, event, of_event)
    watch = DriftMonitor(calibration, DAYS)
    told: list[tuple[str, float]] = []
    for samples in _minutes(after, of_errors, hours):
        acc, gyr = calibration.apply(samples.acc, samples.gyr)
        told += [(each.sensor, each.t_s) for each in watch.add(replace(samples, acc=acc, gyr=gyr))]
        if told and event != "nothing":
            break
    return Row(name=event, seed=seed, told=told)


def _minutes(sensor: SensorTruth, rng: np.random.Generator, hours: float) -> Iterator[Recording]:
    """Yield the sensor's samples in parts, with gaps between the minutes."""
    begun_s, size = 0.0, round(PART_S * RATE_HZ)
    while begun_s < 3600.0 * hours:
        seed, use = int(rng.integers(2**31)), str(rng.choice(USES))
        recording = at(hand_scenario(seed, use, tremble=True, rate_hz=RATE_HZ, sensor=sensor).recording, TEMPERATURE_C)
        every = np.floor(recording.t / GIVES_S).astype(int)
        acc = recording.acc + rng.normal(0.0, FLOOR_MPS2, (every[-1] + 1, 3))[every]
        gap = np.arange(len(recording)) == 0
        minute = replace(recording, acc=acc, gap=gap, t=recording.t + begun_s)
        for first in range(0, len(minute), size):
            yield minute.part(first, first + size)
        begun_s = float(minute.t[-1]) + 1.0


def minutes_until(runs: Sequence[Row], share: float) -> str:
    """Return the minutes until a warning for this share of the sensors; empty if there was none."""
    minutes = [run.told[0][1] / 60.0 if run.told else np.inf for run in runs]
    told = float(np.quantile(minutes, share, method="higher"))
    return f"{told:.1f}" if np.isfinite(told) else ""


COLUMNS: dict[str, Column] = {
    "sensors": len,
    "told": count("told"),
    "warnings": lambda runs: sum(len(run.told) for run in runs),
    "minutes until, first": partial(minutes_until, share=0.0),
    "median": partial(minutes_until, share=0.5),
    "90 %": partial(minutes_until, share=0.9),
    "last": partial(minutes_until, share=1.0),
}


def scenarios(
    *, seeds: range, only: Annotated[Sequence[str], names_of(WATCHED), "events, with ; between"] = WATCHED
) -> list[tuple[str, int]]:
    """Return pairs of an event and a seed."""
    return events(seeds, only)


main = Trial(__doc__, of_use, scenarios, COLUMNS, title="{hours:g} h each")
