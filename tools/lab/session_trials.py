"""Sessions on the simulated chip, one a seed, in hands that follow the guidance, or turn as they like.

    python -m tools.lab session_trials --seeds 50 --of guided placing random wandering

An error is that of a calibrated reading, rms over all directions; claims are errors in units of what is claimed. Times
are simulated seconds since the start. Exit code 1 where one ended as it should not. Sessions with faults are those of
`python -m tools.lab campaign`.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np

from mpucal.result.calibration import GOOD, REFUSED, USABLE
from mpucal.session.events import Decision, PromptKind, Verification
from mpucal.session.plan import Plan
from mpucal.simulated.disturbance import ARMS
from mpucal.simulated.hands import HANDS

from .judge import rms
from .runner import Trial, each_seed
from .sessions import ABANDONED, NOTHING, SilentOperator, judge_session, session
from .table import Column, Row, count, frequencies, known, over

HELD = (*HANDS, *(f"guided,arm={arm}" for arm in ARMS))


def of_hand(item: tuple[str, int]) -> Row:
    """Run a session in a hand, and note the times of its steps."""
    name, seed = item
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


def scenarios(*, seeds: range, of: Annotated[Sequence[str], HELD] = ("guided",)) -> list[tuple[str, int]]:
    """Return each hand with each seed."""
    return each_seed(of, seeds)


def typical(name: str, middle: Callable[[Sequence[float]], Any] = np.median) -> Column:
    """Return a column: the median (or mean) of the known values, and the largest."""
    return lambda group: f"{middle(values):.3g} ({max(values):.3g})" if (values := known(group, name)) else ""


def number_of(verdict: str) -> Column:
    """Return a column: the number of sessions with this verdict, empty for none."""
    return lambda group: count("verdict", verdict)(group) or ""


def most_claims(verdict: str) -> Column:
    """Return a column: the largest error with this verdict, in units of the claim."""
    return lambda group: over("claims", max)([ended for ended in group if ended.verdict == verdict])


COLUMNS: dict[str, Column] = {
    "all": len,
    **{verdict: number_of(verdict) for verdict in (GOOD, USABLE, REFUSED, ABANDONED, NOTHING)},
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


main = Trial(__doc__, of_hand, scenarios, COLUMNS, seeds="4:5", line=line)
