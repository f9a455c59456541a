"""`mpucal check` on simulated pairs of a calibration and a check with known truth.

python -m tools.lab check_trials --seeds 504                     results by what happened, all events equally often
python -m tools.lab check_trials --only nothing --seeds 2000     false alarms

A pair is an MPU-6050 in a trembling hand: twelve poses make the calibration, a flat rest and the three orientations
that are asked for, each missed by some degrees, the check; with `--any` any three. Every sensor also ages by five days,
as `mpucal.recheck.drift` says of an unchanged one. Its rests and turns have the errors that `mpucal.recheck.observed`
assumes of every mounting and every gyroscope.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

import numpy as np

import mpucal
from mpucal.calibration.rotation import rotation
from mpucal.calibration.verification import BIAS_RAD_S, FLOOR_MPS2, FLOOR_RAD
from mpucal.data import Sensor, Vector
from mpucal.recheck import check, drift
from mpucal.recheck.observed import BETA, NOISE, TURN_NONLINEARITY, apply_errors
from mpucal.result.calibration import REFUSED
from mpucal.result.error_model import MG_PER_MPS2
from mpucal.simulated.sensor import SensorTruth

from .judge import rms
from .runner import Trial, names_of
from .scenarios.course import FLAT_S, direction
from .scenarios.recordings import CHECK_S, hand_scenario
from .scenarios.sensors import GRAVITY_MPS2, hand_sensor
from .table import Column, Row, over

DAYS, TEMPERATURE_C = 5.0, 25.0
# the length of a turn in that motion
MOVE_S = 1.6
UNCHANGED = ("still good", "cannot be told")
EVENTS = (
    "nothing",
    *(f"bias {mg} mg" for mg in (2, 5, 10, 30)),
    "scale 0.3 %",
    "mount 1 deg",
    "15 degC",
    "another sensor",
)


def happened(truth: SensorTruth, event: str, rng: np.random.Generator) -> tuple[SensorTruth, float]:
    """Return the sensor after `event`, of any size in those units, and its temperature."""
    towards = direction(rng)
    match event.split():
        case ["bias", mg, "mg"]:
            return truth._replace(b_a=truth.b_a + float(mg) / MG_PER_MPS2 * towards), TEMPERATURE_C
        case ["scale", percent, "%"]:
            axis = np.eye(3)[rng.integers(3)] * rng.choice([-1.0, 1.0])
            return truth._replace(D=truth.D @ np.diag(1.0 + 0.01 * float(percent) * axis)), TEMPERATURE_C
        case ["mount", deg, "deg"]:
            return truth._replace(D=truth.D @ rotation(np.radians(float(deg)) * towards)), TEMPERATURE_C
        case [by_c, "degC"]:
            spread = drift.BY_TEMPERATURE["MPU-6050"].covariance() * float(by_c) ** 2
            theta = rng.multivariate_normal(np.zeros(len(spread)), spread)
            return aged_by(truth, theta), TEMPERATURE_C + float(by_c)
        case ["another", "sensor"]:
            return hand_sensor(rng), TEMPERATURE_C
    return truth, TEMPERATURE_C


def aged_by(truth: SensorTruth, theta: Vector) -> SensorTruth:
    """Return the sensor after a change theta (23,), see mpucal.recheck.observed."""
    after = apply_errors(mpucal.Calibration(truth.D, truth.b_a, K=truth.K, b_omega=truth.b_omega), theta)
    noise = np.exp(theta[NOISE]) * [truth.accel_noise_density, truth.gyro_noise_density]
    return truth._replace(
        D=after.D,
        b_a=after.b_a,
        K=after.K,
        b_omega=after.b_omega,
        accel_noise_density=noise[0],
        gyro_noise_density=noise[1],
    )


def imperfect(recording: mpucal.Recording, rng: np.random.Generator) -> mpucal.Recording:
    """Return the recording with a mounting that bends in each orientation, and a gyroscope with errors."""
    acc, gyr, step_s = recording.acc.copy(), recording.gyr.copy(), 1.0 / recording.rate_hz
    every_s = CHECK_S / 3
    for k in range(3):
        rest, move = (recording.t >= FLAT_S + every_s * k + begun for begun in (MOVE_S, 0.0))
        move &= ~rest
        angle = float(np.linalg.norm(gyr[move] - gyr[recording.t < FLAT_S].mean(0), axis=1).sum()) * step_s
        std = np.sqrt(FLOOR_RAD**2 + (TURN_NONLINEARITY * angle) ** 2 + (BIAS_RAD_S * every_s) ** 2)
        gyr[move] += rng.normal(0.0, std, 3) / MOVE_S
        rest &= recording.t < FLAT_S + every_s * (k + 1) + MOVE_S
        acc[rest] += rng.normal(0.0, FLOOR_MPS2, 3)
    return replace(recording, acc=acc, gyr=gyr)


def calibrated_and_aged(
    seed: int,
) -> tuple[mpucal.Calibration, SensorTruth, np.random.Generator, np.random.Generator] | None:
    """Return a calibration by twelve poses, its sensor some days later, and what draws further events and errors.

    None where the calibration was refused.
    """
    of_sensor, of_event, of_age, of_errors = np.random.default_rng([seed, 21]).spawn(4)
    before = hand_scenario(2 * seed, "pose12", tremble=True, sensor=hand_sensor(of_sensor))
    calibration = mpucal.calibrate(at(before.recording, TEMPERATURE_C), gravity=GRAVITY_MPS2)
    if calibration.verdict == REFUSED:
        return None
    age = drift.ageing(calibration, DAYS, 0.0)
    aged = aged_by(before.truth, of_age.multivariate_normal(np.zeros(len(age)), age))
    return calibration, aged, of_event, of_errors


def at(recording: mpucal.Recording, temperature_c: float) -> mpucal.Recording:
    """Return the recording at a temperature, its rest to be found."""
    sensor = Sensor(chip="MPU-6050", rate_hz=recording.sensor.rate_hz, temperature_c=temperature_c)
    return replace(recording, sensor=sensor, temperature_c=np.full(len(recording), temperature_c), flat=None)


def of_pair(
    item: tuple[str, int], *, any: Annotated[bool, "any three orientations, not those that are asked for"] = False
) -> Row | None:
    """Calibrate, apply an event, and check; None if the calibration was refused."""
    event, seed = item
    if (begun := calibrated_and_aged(seed)) is None:
        return None
    calibration, aged, of_event, of_errors = begun
    after, temperature_c = happened(aged, event, of_event)
    made = hand_scenario(2 * seed + 1, "check" if any else "check as asked", tremble=True, sensor=after)
    found = check(calibration, imperfect(at(made.recording, temperature_c), of_errors), days=DAYS)
    row = Row(name=event, seed=seed, verdict=found.verdict, what=found.what, probability=found.probability)
    if found.theta is not None:
        off = calibration.D @ found.theta[BETA] + calibration.b_a - after.b_a
        row.error_mg = float(np.abs(off).max()) * MG_PER_MPS2
    return row


def events(seeds: range, only: Sequence[str]) -> list[tuple[str, int]]:
    """Return an event for each seed; all events come equally often."""
    return [(only[number % len(only)], seed) for number, seed in enumerate(seeds)]


def scenarios(
    *, seeds: range, only: Annotated[Sequence[str], names_of(EVENTS), "events, with ; between"] = EVENTS
) -> list[tuple[str, int]]:
    """Return pairs of an event and a seed."""
    return events(seeds, only)


def told_as(rows: Sequence[Row]) -> str:
    """Return the results of the checks, each with its share in %."""
    told = Counter(row.verdict if row.what == "nothing" else row.what for row in rows)
    return ", ".join(f"{name} {100.0 * count / len(rows):.1f}" for name, count in told.most_common())


def shares_of_p(rows: Sequence[Row]) -> str:
    """Return the shares in % of the checks with a probability below 0.1 and 0.5: 10 and 50 % if nothing happened."""
    p = np.array([row.probability for row in rows if row.probability is not None])
    return ", ".join(f"{100.0 * np.mean(p < limit):.1f}" for limit in (0.1, 0.5))


COLUMNS: dict[str, Column] = {
    "pairs": len,
    "called changed, %": lambda of: 100.0 * float(np.mean([row.verdict not in UNCHANGED for row in of])),
    "p below 0.1, 0.5, %": shares_of_p,
    "told as, %": told_as,
    "error, mg": over("error_mg", rms),
}

main = Trial(__doc__, of_pair, scenarios, COLUMNS, seeds="0:504")
