"""Sessions on the simulated chip, one a seed: their ends, their errors, and their times.

    python -m tools.lab session_trials hands --seeds 50 --of guided placing random wandering
    python -m tools.lab session_trials parts

hands: a hand that follows the guidance, beside hands that turn as they like. parts: each part of
mpucal/chip/families.py, simulated by what its row says. Sessions with faults are those of `python -m tools.lab
campaign`.

An error is that of a calibrated reading, rms over all directions; claims are errors in units of what is claimed. Times
are simulated seconds since the start. Exit code 1 where one ended as it should not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np

from mpucal.chip.families import PARTS
from mpucal.result.calibration import GOOD, REFUSED, USABLE
from mpucal.session.events import Decision, PromptKind, Verification
from mpucal.session.plan import Plan
from mpucal.simulated.chip.models import MODELS
from mpucal.simulated.disturbance import ARMS
from mpucal.simulated.hands import HANDS

from .judge import rms
from .runner import Trial
from .sessions import ABANDONED, NOTHING, SilentOperator, by_command, judge_session, session
from .table import Column, Row, count, frequencies, known, over

# limits for a part: the temperature [C], and each element of D
TEMPERATURE_C, NEAR_C, NEAR = 27.0, 0.3, 2e-3
HELD = (*HANDS, *(f"guided,arm={arm}" for arm in ARMS))


def parts() -> dict[str, tuple[str, str]]:
    """Return each part as --bus sim: names it: its name, and where its row is from; revision C is one more."""
    by_family = {model.family: name for name, model in reversed(MODELS.items())}
    found = {
        f"{by_family[part.family]},who_am_i={who_am_i:#04x}": (part.chip, part.family.source)
        for who_am_i, part in PARTS.items()
    }
    return {**found, "mpu6050c": ("MPU-6050C", PARTS[0x68].family.source)}


def of_hand(name: str, seed: int) -> Row:
    """Run a session in that hand, and note the times of its steps."""
    ear = SilentOperator()
    done = session(f"sim:hand={name}", Plan(), seed, ear)
    rotated_s, finished_s = ear.when(PromptKind.VERIFY), ear.when(PromptKind.REST)
    pairs = (
        (v.magnitude_mps2 / v.magnitude_std_mps2, v.direction_deg / v.direction_std_deg) for v in ear.of(Verification)
    )
    return judge_session(
        name,
        seed,
        replace(done, said=done.said or "; ".join(decision.why for decision in ear.of(Decision))),
        rotated_s=finished_s if math.isnan(rotated_s) else rotated_s,
        finished_s=finished_s,
        verified_z=tuple(z for pair in pairs for z in pair),
    )


def of_part(name: str, seed: int) -> Row:
    """Run a session on a part; it must end good, with the right name and temperature."""
    words = ("--bus", f"sim:chip={name},temperature_c={TEMPERATURE_C}", "--seed", str(seed))
    done, document = by_command(*words, "--rate", "50", "--model", "hand")
    if done.calibration is None:
        return judge_session(name, seed, done, "no calibration")
    (chip, source), sensor = parts()[name], document["sensor"]
    error = float(np.abs(done.calibration.D - done.truth["D"]).max())
    near = abs(sensor["temperature_c"] - TEMPERATURE_C) < NEAR_C and error < NEAR
    right = near and done.calibration.verdict == GOOD and sensor["chip"] == chip
    said = f"{sensor['chip']}, {sensor['temperature_c']:.1f} C, D within {error:.1e} ({source})"
    return judge_session(name, seed, replace(done, said=said), "" if right else "not as its row says")


# by name: the items, those of them that are tried by default, and the function that tries one
TRIALS: dict[str, tuple[Sequence[str], Sequence[str], Callable[[str, int], Row]]] = {
    "hands": (HELD, ["guided"], of_hand),
    "parts": ([*parts()], [*parts()], of_part),
}


def tried(item: tuple[str, str, int]) -> Row:
    """Run one session of a trial."""
    trial, name, seed = item
    return TRIALS[trial][2](name, seed)


def scenarios(
    trial: Annotated[str, TRIALS],
    *,
    seeds: range,
    of: Annotated[list[str] | None, "some of it; default: all, or the guided hand"] = None,
) -> list[tuple[str, str, int]]:
    """Return the sessions that are asked for.

    Raises
    ------
    SystemExit : the trial has nothing of such a name.
    """
    names, usual, _ = TRIALS[trial]
    if unknown := set(of or ()) - set(names):
        raise SystemExit(f"{trial} are {', '.join(names)}, and not {', '.join(unknown)}")
    return [(trial, name, seed) for name in of or usual for seed in seeds]


def typical(name: str, middle: Callable[[Sequence[float]], Any] = np.median) -> Column:
    """Return a column: the median (or mean) of the known values, and the largest."""
    return lambda group: f"{middle(values):.3g} ({max(values):.3g})" if (values := known(group, name)) else ""


def most_claims(verdict: str) -> Column:
    """Return a column: the largest error with this verdict, in units of the claim."""
    return lambda group: over("claims", max)([ended for ended in group if ended.verdict == verdict])


COLUMNS: dict[str, Column] = {
    "all": len,
    **{v: lambda g, v=v: count("verdict", v)(g) or "" for v in (GOOD, USABLE, REFUSED, ABANDONED, NOTHING)},
    "rotated s": typical("rotated_s"),
    "finished s": typical("finished_s"),
    "error m/s²": typical("error", np.mean),
    "z": over("z", rms),
    "verified z": over("verified_z", rms),
    "claims of good": most_claims(GOOD),
    "of usable": most_claims(USABLE),
    "reasons": lambda group: frequencies(ended.reasons[0] for ended in group if ended.reasons),
}


def line(ended: Row) -> str:
    """Return how a session ended, in a line."""
    mark = f"WRONG {ended.wrong}: " if ended.wrong else ""
    return f"{mark}{ended.name}, seed {ended.seed}: {ended.verdict}, {ended.error:.4f} m/s² {ended.said}"


main = Trial(__doc__, tried, scenarios, COLUMNS, seeds="4:5", line=line)
