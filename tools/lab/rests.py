"""Compare the rests that a session detects as samples arrive with the rests of the whole recording.

python -m tools.lab rests                                     six recordings of each family, about 500
python -m tools.lab rests --families 'poses*' --seeds 0:33

A recording agrees if the session detects the same holds from samples in parts of any size as from all at once, if each
hold is a rest of the recording, and if each rest of this length is a hold. The exit code is 1 if fewer recordings than
--least agree.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from typing import Annotated

import numpy as np

from mpucal.calibration.masks import with_masks
from mpucal.data import Recording, Samples
from mpucal.rests.flat import Flat, find_flat, flat_statistics
from mpucal.rests.intervals import RestFinder
from mpucal.session.events import Rested
from mpucal.session.pauses import HOLD_S, PauseDetector

from .runner import Trial
from .scenarios.family import simulate
from .scenarios.table import FAMILIES, of_families
from .table import Row, first, grouped, show, table

LARGEST_PART = 60  # samples
# a rest of this length contains all windows of a hold, even after its ends are trimmed
LONG_S = HOLD_S

Span = tuple[float, float]


def of_seed(item: tuple[str, int]) -> Row:
    """Compare the recording of a family's name and a seed."""
    name, seed = item
    return of_recording(with_masks(simulate(FAMILIES[name], seed).recording), name, seed)


def of_recording(recording: Recording, name: str, seed: int) -> Row:
    """Compare a recording; the seed draws how its samples arrive.

    A row has the numbers of holds, and of rests as long as one, and what only one of them has: spans [s].
    """
    segment = recording.flat or find_flat(recording)
    if segment is None or segment[1] == len(recording):
        return Row(name=name, seed=seed, flat=False)
    flat = flat_statistics(recording, segment)
    after = recording.part(flat.last, len(recording))
    ends = np.cumsum(np.random.default_rng(seed).integers(1, LARGEST_PART, len(after)))
    parts = [after.part(first, last) for first, last in pairwise([0, *ends[ends < len(after)].tolist(), len(after)])]
    held = _held(flat, parts)
    runs = RestFinder(recording, flat).any_hand()
    found: list[Span] = [(float(recording.t[a]), float(recording.t[b - 1])) for a, b in runs if a >= flat.last]
    rests = [rest for rest in found if rest[1] - rest[0] >= LONG_S]
    only_held = [hold for hold in held if not _touched(hold, found)]
    only_rests = [rest for rest in rests if not _touched(rest, held)]
    return Row(
        **{"name": name, "seed": seed, "flat": True, "held": len(held), "rests": len(rests)},
        **{"only_held": only_held, "only_rests": only_rests},
        agrees=held == _held(flat, [after]) and not only_held and not only_rests,
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


COLUMNS = {
    "held": first("held"),
    "rests": first("rests"),
    "only\nheld": lambda found: len(found[0].only_held),
    "only\nrests": lambda found: len(found[0].only_rests),
}


def report(of_all: list[Row], *, least: Annotated[float, "the share that is to agree"] = 0.0) -> int:
    """Print the recordings that differ, and the number that agree; return 1 if too few agree."""
    found = [one for one in of_all if one.flat]
    differ = [one for one in found if not one.agrees]
    if differ:
        show(table(grouped(differ, "name", "seed"), COLUMNS))
    agreeing, more = len(found) - len(differ), len(of_all) - len(found)
    print(f"{agreeing} of {len(found)} agree; {more} more have no flat segment")
    return int(agreeing < least * len(found))


main = Trial(__doc__, of_seed, of_families, report=report, seeds="0:6")
