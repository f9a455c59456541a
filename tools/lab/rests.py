"""Compare the rests that a session detects as samples arrive with the rests of the whole recording.

python -m tools.lab rests                                     six recordings of each family, about 500
python -m tools.lab rests --families 'poses*' --seeds 0:33

A recording agrees if the session detects the same holds from samples in parts of any size as from all at once, if each
hold is a rest of the recording, and if each rest of this length is a hold. The exit code is 1 if fewer recordings than
--least agree.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mpucal.calibration.masks import with_masks
from mpucal.data import Recording, Samples
from mpucal.rests.flat import Flat, find_flat, flat_statistics
from mpucal.rests.intervals import RestFinder
from mpucal.session.events import Rested
from mpucal.session.pauses import HOLD_S, PauseDetector

from .runner import Asked, Program, names_of, option
from .scenarios.family import simulate
from .scenarios.table import FAMILIES
from .table import grouped, show, table

LARGEST_PART = 60  # samples
# a rest of this length contains all windows of a hold, even after its ends are trimmed
LONG_S = HOLD_S

Span = tuple[float, float]


@dataclass(frozen=True)
class Found:
    """Holds detected live and rests found offline in one recording, and those [s] that only one of them has.

    Attributes
    ----------
    flat : it has a flat segment, and something after it.
    held, rests : numbers of holds, and of rests as long as a hold. in_parts : parts give the same as all at once.
    """

    family: str
    seed: int
    flat: bool = True
    held: int = 0
    rests: int = 0
    only_held: tuple[Span, ...] = ()
    only_rests: tuple[Span, ...] = ()
    in_parts: bool = True

    @property
    def agrees(self) -> bool:
        """Return True if both agree, however the samples arrive."""
        return self.in_parts and not self.only_held and not self.only_rests


def of_seed(item: tuple[str, int]) -> Found:
    """Compare the recording of a family's name and a seed."""
    name, seed = item
    return of_recording(with_masks(simulate(FAMILIES[name], seed).recording), name, seed)


def of_recording(recording: Recording, name: str, seed: int) -> Found:
    """Compare a recording; the seed draws how its samples arrive."""
    segment = recording.flat or find_flat(recording)
    if segment is None or segment[1] == len(recording):
        return Found(name, seed, flat=False)
    flat = flat_statistics(recording, segment)
    after = recording.part(flat.last, len(recording))
    ends = np.cumsum(np.random.default_rng(seed).integers(1, LARGEST_PART, len(after)))
    parts = [after.part(first, last) for first, last in pairwise([0, *ends[ends < len(after)].tolist(), len(after)])]
    held = _held(flat, parts)
    runs = RestFinder(recording, flat).any_hand()
    found: list[Span] = [(float(recording.t[a]), float(recording.t[b - 1])) for a, b in runs if a >= flat.last]
    rests = [rest for rest in found if rest[1] - rest[0] >= LONG_S]
    return Found(
        name,
        seed,
        True,
        len(held),
        len(rests),
        tuple(hold for hold in held if not _touched(hold, found)),
        tuple(rest for rest in rests if not _touched(rest, held)),
        held == _held(flat, [after]),
    )


def _held(flat: Flat, parts: Iterable[Samples]) -> list[Span]:
    """Return the holds that the session detects as these samples arrive."""
    x, y, z, *rates = (*flat.y.tolist(), *flat.b_omega.tolist())
    pauses = PauseDetector(Rested(flat.n, (x, y, z), (rates[0], rates[1], rates[2])))
    # a session ignores the rest in which it begins
    pauses.leave(-1)
    runs: dict[int, Span] = {}
    for pause in (pause for samples in parts for pause in pauses.add(samples)):
        if pause.seconds >= HOLD_S:
            runs[pause.run] = (runs.get(pause.run, (pause.t_s - pause.seconds,))[0], pause.t_s)
    return list(runs.values())


def _touched(span: Span, others: Iterable[Span]) -> bool:
    return any(first < span[1] and span[0] < last for first, last in others)


def agreeing(found: Sequence[Found]) -> str:
    """Return the number that agree, of all."""
    return f"{sum(one.agrees for one in found)} of {len(found)}"


COLUMNS = {
    "agree": agreeing,
    "held": lambda found: sum(one.held for one in found),
    "rests": lambda found: sum(one.rests for one in found),
    "only\nheld": lambda found: sum(len(one.only_held) for one in found),
    "only\nrests": lambda found: sum(len(one.only_rests) for one in found),
}


def report(of_all: list[Found], asked: Asked) -> int:
    """Print the recordings that differ, and the number that agree; return 1 if too few agree."""
    found = [one for one in of_all if one.flat]
    differ = [one for one in found if not one.agrees]
    if differ:
        show(table(grouped(differ, "family", "seed"), COLUMNS))
    print(f"{agreeing(found)} agree; {len(of_all) - len(found)} more have no flat segment")
    return int(len(found) - len(differ) < asked.least * len(found))


main = Program(
    __doc__,
    of_seed,
    items=lambda asked: [(name, seed) for name in asked.families for seed in asked.seeds],
    report=report,
    options=(
        option("--families", type=names_of(FAMILIES), default=list(FAMILIES), help="patterns, with ; between"),
        option("--least", type=float, default=0.0, help="the share that is to agree"),
    ),
    seeds="0:6",
)
