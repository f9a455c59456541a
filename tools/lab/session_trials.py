"""Sessions on the simulated chip, one a seed: their ends, their errors, and their times.

    python -m tools.lab session_trials hands --seeds 50 --of guided placing random wandering
    python -m tools.lab session_trials damage --seeds 7000:7050
    python -m tools.lab session_trials parts

hands: a hand that follows the guidance, beside hands that turn as they like. parts: each part of
mpucal/chip/families.py, simulated by what its row says. damage: what nobody announces begins while the board is turned
or verified: a step of 3 to 30 mg of the bias (zero; both sides count as true), a low byte that is lost (byte), one byte
in 2,000 with a flipped bit (bits), or nothing (none).

An error is that of a calibrated reading, rms over all directions; claims are errors in units of what is claimed. Times
are simulated seconds since the start. Exit code 1 where one ended as it should not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from mpucal.chip.config import Config
from mpucal.chip.families import PARTS
from mpucal.result.calibration import GOOD, REFUSED, USABLE
from mpucal.result.error_model import MG_PER_MPS2
from mpucal.session.events import Decision, PromptKind, Verification
from mpucal.session.plan import Plan
from mpucal.simulated.chip.models import MODELS
from mpucal.simulated.disturbance import ARMS
from mpucal.simulated.hands import HANDS
from mpucal.simulated.mishaps import ZeroStep

from .judge import rms
from .runner import Asked, Program, option, seed_range
from .sessions import ABANDONED, NOTHING, JudgedSession, SilentOperator, by_command, judge_session, session
from .table import Column, count, frequencies, grouped, known, over, show, table

RATE_HZ = 50.0
# limits for a part: the temperature [C], and each element of D
TEMPERATURE_C, NEAR_C, NEAR = 27.0, 0.3, 2e-3
HELD = (*HANDS, *(f"guided,arm={arm}" for arm in ARMS))
DAMAGES = {"zero": None, "byte": "low_byte", "bits": "bit_errors", "none": None}
DAMAGED_S, STEP_MG = (12.0, 75.0), (3.0, 30.0)


def parts() -> dict[str, tuple[str, str]]:
    """Return each part as --bus sim: names it: its name, and where its row is from; revision C is one more."""
    by_family = {model.family: name for name, model in reversed(MODELS.items())}
    found = {
        f"{by_family[part.family]},who_am_i={who_am_i:#04x}": (part.chip, part.family.source)
        for who_am_i, part in PARTS.items()
    }
    return {**found, "mpu6050c": ("MPU-6050C", PARTS[0x68].family.source)}


def of_hand(name: str, seed: int) -> JudgedSession:
    """Run a session in that hand, and note the times of its steps."""
    ear = SilentOperator()
    done = session(f"sim:hand={name}", Plan(), seed, ear)
    rotated_s, finished_s = ear.when(PromptKind.VERIFY), ear.when(PromptKind.REST)
    return JudgedSession(
        **asdict(done.judged()),
        name=name,
        seed=seed,
        said=done.said or "; ".join(decision.why for decision in ear.of(Decision)),
        rotated_s=finished_s if math.isnan(rotated_s) else rotated_s,
        finished_s=finished_s,
        verified_z=tuple(
            z
            for v in ear.of(Verification)
            for z in (v.magnitude_mps2 / v.magnitude_std_mps2, v.direction_deg / v.direction_std_deg)
        ),
    )


def of_part(name: str, seed: int) -> JudgedSession:
    """Run a session on a part; it must end good, with the right name and temperature."""
    words = ("--bus", f"sim:chip={name},temperature_c={TEMPERATURE_C}", "--seed", str(seed))
    done, document = by_command(*words, "--rate", f"{RATE_HZ:g}", "--model", "hand")
    if done.calibration is None:
        return judge_session(name, seed, done, "no calibration")
    (chip, source), sensor = parts()[name], document["sensor"]
    error = float(np.abs(done.calibration.D - done.truth["D"]).max())
    near = abs(sensor["temperature_c"] - TEMPERATURE_C) < NEAR_C and error < NEAR
    right = near and done.calibration.verdict == GOOD and sensor["chip"] == chip
    said = f"{sensor['chip']}, {sensor['temperature_c']:.1f} C, D within {error:.1e} ({source})"
    return judge_session(name, seed, replace(done, said=said), "" if right else "not as its row says")


def of_damage(name: str, seed: int) -> JudgedSession:
    """Run a session with damage that nothing reports."""
    rng = np.random.default_rng([seed, list(DAMAGES).index(name)])
    at_s, direction = round(float(rng.uniform(*DAMAGED_S)), 1), rng.normal(size=3)
    step = direction / np.linalg.norm(direction) * math.exp(rng.uniform(*np.log(STEP_MG))) / MG_PER_MPS2
    zero = ZeroStep(step)
    if name == "zero":
        zero.begin(at_s)
    words = f"sim:fault={DAMAGES[name]}@{at_s}" if DAMAGES[name] else "sim"
    done = session(words, Plan(Config(rate_hz=RATE_HZ)), seed, mishaps=(zero,))
    stepped = name == "zero" and done.recording is not None and done.recording.t[-1] > at_s
    return judge_session(name, seed, done, "", *([step] if stepped else []))


# trials by name: the items, the function that tries one, and the default seeds
TRIALS: dict[str, tuple[Sequence[str], Callable[[str, int], JudgedSession], str]] = {
    "hands": (HELD, of_hand, "50"),
    "parts": (tuple(parts()), of_part, "4:5"),
    "damage": (tuple(DAMAGES), of_damage, "40"),
}


def tried(item: tuple[str, str, int]) -> JudgedSession:
    """Run one session of a trial."""
    trial, name, seed = item
    return TRIALS[trial][1](name, seed)


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


def items(asked: Asked) -> list[tuple[str, str, int]]:
    """Return the sessions that are asked for.

    Raises
    ------
    SystemExit : the trial has nothing of such a name.
    """
    names, _, seeds = TRIALS[asked.trial]
    chosen = asked.of or (["guided"] if asked.trial == "hands" else names)
    if unknown := set(chosen) - set(names):
        raise SystemExit(f"{asked.trial} are {', '.join(names)}, and not {', '.join(unknown)}")
    return [(asked.trial, name, seed) for name in chosen for seed in asked.seeds or seed_range(seeds)]


def line(ended: JudgedSession) -> str:
    """Return how a session ended, in a line."""
    mark = f"WRONG {ended.wrong}: " if ended.wrong else ""
    return f"{mark}{ended.name}, seed {ended.seed}: {ended.verdict}, {ended.error:.4f} m/s² {ended.said}"


def report(found: list[JudgedSession], asked: Asked) -> int:
    """Print a line for each group; return 1 if a session ended wrongly."""
    show(table(grouped(found, "name"), COLUMNS))
    return int(any(ended.wrong for ended in found))


main = Program(
    __doc__,
    tried,
    items,
    report,
    options=(
        option("trial", choices=TRIALS),
        option("--of", nargs="+", metavar="NAME", help="some of it; default: all, or the guided hand"),
    ),
    seeds=None,
    line=line,
)
