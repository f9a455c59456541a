"""New parameters written to a vehicle, all of them or none."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

from ...errors import EndOfCapture, MpucalError, WriteBackError
from ...result.journal import Journal
from ..link import Link, S
from ..prearm import ArmingMonitor
from .client import ParameterClient
from .encoding import as_float32
from .names import Slot

# PX4 takes a vector over where it differs by more than 0.01 from the one in use: the last axis goes by a detour
DETOUR = 0.05
TAKEN_OVER_NS = S // 4
# of the journal
OLD, NEW = "old", "new"

FAILURES = (MpucalError, EndOfCapture, KeyboardInterrupt, MemoryError)


class Step(NamedTuple):
    """Set `name` to `value`, then wait for `wait_ns`."""

    name: str
    value: float
    wait_ns: int = 0


class Writer:
    """Writes to the vehicle that `link` is locked to, while it is disarmed.

    Parameters
    ----------
    watch : hears its heartbeats. slots : whose parameters are written. journal : notes old and new meanwhile.

    Attributes
    ----------
    restored : a write failed, and the old parameters are back.
    """

    def __init__(self, link: Link, watch: ArmingMonitor, slots: Sequence[Slot], journal: Journal | None = None) -> None:
        self._link, self._watch, self._slots = link, watch, tuple(slots)
        self._parameters = ParameterClient(link)
        self._journal = journal or Journal()
        self._touched: set[str] = set()
        self.restored = False

    def read(self) -> dict[str, float]:
        """What the vehicle holds there.

        Raises
        ------
        LinkError : it does not say, or says two things.
        """
        names = [name for where in self._slots for name in where.names]
        return {name: float(value) for name, value in self._parameters.read_agreed(names).items()}

    def write(self, old: Mapping[str, float], new: Mapping[str, float], verify: Callable[[], None]) -> None:
        """Set what of `new` is not in `old`, read all back, `verify`; on any failure put `old` back.

        Raises
        ------
        WriteBackError : it failed; what it says ends with what the vehicle holds now.
        """
        if self._watch.armed:
            raise WriteBackError("the vehicle is armed, so nothing was written", "disarm it, then write again")
        self._journal.begin({OLD: dict(old), NEW: dict(new)})
        try:
            for where, names in self._vectors():
                if any(as_float32(new[name]) != old[name] for name in names):
                    for step in _steps(where, names, new):
                        self._disarmed()
                        self._set(step)
            self._compare(new)
            verify()
            self._disarmed()
        except FAILURES as failure:
            self._restore(old, failure)
        self._journal.end()

    def _vectors(self) -> Iterator[tuple[Slot, tuple[str, ...]]]:
        for where in self._slots:
            yield where, where.offset
            yield where, where.scale

    def _set(self, step: Step) -> None:
        self._parameters.set(step.name, step.value)
        self._touched.add(step.name)
        list(self._link.messages(self._link.now_ns() + step.wait_ns))

    def _disarmed(self) -> None:
        if self._watch.armed:
            raise WriteBackError("the vehicle was armed meanwhile", "disarm it, then write again")

    def _compare(self, values: Mapping[str, float]) -> None:
        for name, held in self._parameters.find_mismatches(values).items():
            raise WriteBackError(
                f"{name} reads back as {held:.9g}, not {values[name]:.9g}", "see who else writes parameters"
            )

    def _restore(self, old: Mapping[str, float], failure: BaseException) -> None:
        """Put `old` back, armed or not: half a correction is worse than either; then raise."""
        what = failure.what if isinstance(failure, MpucalError) else "the write was interrupted"
        remedy = failure.remedy if isinstance(failure, MpucalError) else "start again"
        try:
            for where, names in self._vectors():
                held = self._parameters.read(names)
                # one that was refused holds its old value, and would be refused again
                changed = [name for name in names if name in self._touched or held[name] != old[name]]
                for step in _steps(where, changed, old):
                    self._set(step)
            self._compare(old)
        except FAILURES as second:
            why = second.what if isinstance(second, MpucalError) else "interrupted"
            raise WriteBackError(
                f"{what}, and the old parameters could not be put back ({why})",
                "load the file of old parameters with your ground station before the next flight",
            ) from failure
        self.restored = True
        self._journal.end()
        raise WriteBackError(f"{what}; the old parameters are back, and read back as they were", remedy) from failure


def is_partial_write(held: Mapping[str, float], old: Mapping[str, float], new: Mapping[str, float]) -> bool:
    """Whether a write from `old` to `new` that was cut off can have left this: each is one of both, or a detour."""
    reach = DETOUR * 1.01
    return all(min(abs(held[name] - old[name]), abs(held[name] - new.get(name, old[name]))) <= reach for name in old)


def _steps(where: Slot, names: Sequence[str], values: Mapping[str, float]) -> Iterator[Step]:
    """How `names` of one vector come to `values`, which holds all of it.

    Where the firmware does not notice small changes, it then uses what it would use after a start.
    """
    wanted = where.correction(values)
    if not where.limits.unnoticed or wanted is None or not names:
        yield from (Step(name, values[name]) for name in names)
        return
    used = where.values(where.effective(wanted))
    *first, last = names
    yield from (Step(name, used[name]) for name in first)
    yield Step(last, used[last] + DETOUR, TAKEN_OVER_NS)
    yield Step(last, used[last], TAKEN_OVER_NS)
    yield from (Step(name, values[name]) for name in names if values[name] != used[name])
