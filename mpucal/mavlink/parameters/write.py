"""New parameters written to a vehicle, all of them or none, and verified by its streams at rest."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import permutations
from typing import NamedTuple

import numpy as np

from ...clocks import S
from ...data import STANDARD_GRAVITY_MPS2, Vector
from ...errors import EndOfCapture, MpucalError, WriteBackError
from ...result.journal import Journal
from ..link import Link
from ..requests import is_armed
from ..rest import RestMeans
from .client import read_agreed, require_parameters, set_parameter
from .encoding import as_float32
from .mounting import trim_names
from .plan import Change
from .slots import Slot, all_slots

# Tolerances: a step of the stream; standard deviations of the means; part of an attitude change by the gyroscope.
AGREE_MPS2, SIGMAS, PER_TURN = 0.03, 3.0, 0.05
MOST_TURNED_RAD = 0.1


class SwappedSlotsError(WriteBackError):
    """The streams show that the parameters act on one another's IMUs.

    Parameters
    ----------
    order : for each change, the index of the one whose slot acts on its IMU.
    """

    def __init__(self, order: tuple[int, ...]) -> None:
        super().__init__("the vehicle's IMUs are in another order than its parameters", "write again")
        self.order = order


def verify(
    planned: Sequence[Change], old: Mapping[str, float], before: RestMeans, after: RestMeans | None, turn: Vector
) -> None:
    """Check that each stream changed as its new parameters must change it.

    Parameters
    ----------
    old : the vehicle's parameters before the write, by name. before, after : its streams at rest then and now.
    turn : rotation (3, 3) of the streams by the new level.

    Raises
    ------
    SwappedSlotsError : every stream shows the new parameters of another IMU. WriteBackError : a stream shows neither.
    """
    if after is None:
        raise WriteBackError("the vehicle did not lie still while its new parameters were verified", "set it down")
    turned = before.attitude.T @ after.attitude
    angle = float(np.linalg.norm(turned - np.eye(3)) / np.sqrt(2))
    if angle > MOST_TURNED_RAD:
        raise WriteBackError(
            f"the vehicle was turned by {np.degrees(angle):.0f} deg while its new parameters were verified",
            "set it down, do not touch it, and write again",
        )

    def excess(imu: Change, at: Change) -> float:
        """Return by how much [m/s^2] the stream of `imu` misses the prediction of slot `at` beyond the tolerances."""
        held = at.slot.correction(old)
        if held is None or not held.scale.all():
            return 0.0
        expected = turn @ at.slot.effective(held).recorrect(at.new, imu.mounting, before.mean[imu.stream])
        apart: Vector = np.abs(after.mean[imu.stream] - turned.T @ expected)
        noise = np.hypot(before.error[imu.stream], after.error[imu.stream])
        return float((apart - AGREE_MPS2 - SIGMAS * noise).max() - PER_TURN * angle * STANDARD_GRAVITY_MPS2)

    # Rows: the IMUs' streams; columns: the slots.
    misses = np.array([[excess(imu, at) for at in planned] for imu in planned])
    indices = tuple(range(len(planned)))
    fitting = [order for order in permutations(indices) if all(misses[i, order[i]] <= 0 for i in indices)]
    if indices in fitting:
        return
    if len(fitting) == 1:
        raise SwappedSlotsError(fitting[0])
    worst = max(indices, key=lambda i: misses[i, i])
    raise WriteBackError(
        f"IMU {planned[worst].imu}'s stream does not show its new parameters, by {misses[worst, worst]:.3f} m/s^2 more"
        " than it may differ",
        "check that nobody else writes parameters, and how they say it is mounted, then calibrate again",
    )


# PX4 takes a vector over if it differs by more than 0.01 from the one in use: the last axis is set off by this first.
DETOUR = 0.05
TAKEN_OVER_NS = S // 4
# Keys of the journal
OLD, NEW = "old", "new"

FAILURES = (MpucalError, EndOfCapture, KeyboardInterrupt, MemoryError)


class Step(NamedTuple):
    """Set parameter `name` to `value`, then wait for `wait_ns`."""

    name: str
    value: float
    wait_ns: int = 0


class Writer:
    """Writer to the vehicle that `link` is locked to, while it is disarmed.

    Parameters
    ----------
    names : of the parameters to be written: those of whole slots and of the trim; others are ignored.
    journal : keeps old and new values meanwhile.

    Attributes
    ----------
    slots : to be written. restored : True after a write that failed and whose old parameters are back.
    """

    def __init__(self, link: Link, names: Iterable[str], journal: Journal | None = None) -> None:
        given, firmware = set(names), link.vehicle.family
        self.slots = [slot for slot in all_slots(firmware) if given.issuperset(slot.names)]
        self._others = [name for name in trim_names(firmware) if name in given]
        self._link = link
        self._journal = journal or Journal()
        self._touched: set[str] = set()
        self.restored = False

    def read(self) -> dict[str, float]:
        """Return the vehicle's values of all parameters to be written.

        Raises
        ------
        LinkError : it does not answer, or with two values.
        """
        return read_agreed(self._link, [name for _, names in self._vectors() for name in names])

    def write(self, old: Mapping[str, float], new: Mapping[str, float], verify: Callable[[], None]) -> None:
        """Set the values of `new` that differ from `old`, read all back, `verify`; restore `old` on any failure.

        Raises
        ------
        WriteBackError : it failed; the message ends with the values that the vehicle has now.
        """
        if is_armed(self._link):
            raise WriteBackError("the vehicle is armed, so nothing was written", "disarm it, then write again")
        self._journal.begin({OLD: dict(old), NEW: dict(new)})
        try:
            for slot, names in self._vectors():
                if any(as_float32(new[name]) != old[name] for name in names):
                    for step in _steps(slot, names, new):
                        self._check_disarmed()
                        self._set(step)
            self._compare(new)
            verify()
            self._check_disarmed()
        except FAILURES as failure:
            self._restore(old, failure)
        self._journal.end()

    def _vectors(self) -> Iterator[tuple[Slot | None, tuple[str, ...]]]:
        for slot in self.slots:
            yield slot, slot.offset
            yield slot, slot.scale
        for name in self._others:
            yield None, (name,)

    def _set(self, step: Step) -> None:
        set_parameter(self._link, step.name, step.value)
        self._touched.add(step.name)
        list(self._link.messages(self._link.now_ns() + step.wait_ns))

    def _check_disarmed(self) -> None:
        if is_armed(self._link):
            raise WriteBackError("the vehicle was armed meanwhile", "disarm it, then write again")

    def _compare(self, values: Mapping[str, float]) -> None:
        for name, held in require_parameters(self._link, tuple(values)).items():
            if held != as_float32(values[name]):
                raise WriteBackError(
                    f"{name} reads back as {held:.9g}, not {values[name]:.9g}", "find out who else writes parameters"
                )

    def _restore(self, old: Mapping[str, float], failure: BaseException) -> None:
        """Restore `old`, even while armed: half a correction is worse than either; then raise."""
        what = failure.what if isinstance(failure, MpucalError) else "the write was interrupted"
        remedy = failure.remedy if isinstance(failure, MpucalError) else "start again"
        try:
            for slot, names in self._vectors():
                held = require_parameters(self._link, names)
                # A parameter that was refused holds its old value, and would be refused again.
                changed = [name for name in names if name in self._touched or held[name] != old[name]]
                for step in _steps(slot, changed, old):
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
    """Return True if an interrupted write from `old` to `new` can have left `held`.

    Each value is then within DETOUR of its old or its new one.
    """
    reach = DETOUR * 1.01
    return all(min(abs(held[name] - old[name]), abs(held[name] - new.get(name, old[name]))) <= reach for name in old)


def _steps(slot: Slot | None, names: Sequence[str], values: Mapping[str, float]) -> Iterator[Step]:
    """Yield the steps that set `names` of one vector to `values`, which holds all of it.

    If the firmware ignores small changes, the steps have it use the same values at once as after a start.
    """
    wanted = None if slot is None else slot.correction(values)
    if slot is None or not slot.limits.unnoticed or wanted is None or not names:
        yield from (Step(name, values[name]) for name in names)
        return
    used = slot.values(slot.effective(wanted))
    *first, last = names
    yield from (Step(name, used[name]) for name in first)
    yield Step(last, used[last] + DETOUR, TAKEN_OVER_NS)
    yield Step(last, used[last], TAKEN_OVER_NS)
    yield from (Step(name, values[name]) for name in names if values[name] != used[name])
