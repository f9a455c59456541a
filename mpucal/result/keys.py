"""Types of the mappings `fit` and `quality` for type checkers, and the immutable dict that holds them.

The keys are those of a result of `calibrate`. From a config blob `quality` is empty, and `fit` has the gravity alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, NoReturn, NotRequired, TypedDict

from ..reasons import ReasonFound

if TYPE_CHECKING:
    from typing_extensions import ReadOnly  # part of every type checker

Verdict = Literal["good", "usable", "refused"]
Number = float | None  # NaN or None (null in the file) if unknown


class FrozenDict(dict[str, Any]):
    """Dict that cannot be changed (TypeError); unlike a mapping proxy it can be pickled, copied and dumped as JSON."""

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        raise TypeError("this mapping cannot be changed: make a dict of it")

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[type[FrozenDict], tuple[dict[str, Any]]]:
        # pickle would set the items one by one
        return FrozenDict, (dict(self),)


class Magnitude(TypedDict):
    """Statistics of |a| over all samples [m/s^2]."""

    median: ReadOnly[Number]
    mean: ReadOnly[Number]
    std: ReadOnly[Number]


class ErrorStd(TypedDict):
    """Standard uncertainty of a calibrated measurement over all directions [m/s^2, deg], and its parts."""

    rms: ReadOnly[Number]
    magnitude: ReadOnly[Number]
    direction_deg: ReadOnly[Number]
    model: ReadOnly[Number]
    time: ReadOnly[Number]
    side: ReadOnly[Number]
    change: ReadOnly[Number]
    decided_by: ReadOnly[Literal["model", "time", "side", "change"] | None]


class Verification(TypedDict):
    """Result of the verification in new orientations; `agrees` is None if none was shown."""

    agrees: ReadOnly[bool | None]
    orientations: ReadOnly[Sequence[Mapping[str, Any]]]


class Quality(TypedDict):
    """Mapping `quality` of calibration.json; `verification` only after a session's verification."""

    verdict: ReadOnly[Verdict]
    reasons: ReadOnly[Sequence[ReasonFound]]
    magnitude_before: ReadOnly[Magnitude]
    magnitude_after: ReadOnly[Magnitude]
    error_std: ReadOnly[ErrorStd]
    verification: NotRequired[ReadOnly[Verification]]


class Fit(TypedDict):
    """Mapping `fit` of calibration.json: the model, the reason for its choice, and the course of the estimation."""

    model: ReadOnly[str]
    why: ReadOnly[str]
    parameters: ReadOnly[int]
    iterations: ReadOnly[int]
    converged: ReadOnly[bool]
    nis: ReadOnly[Number]
    gravity: ReadOnly[Number]
    gravity_anyway: NotRequired[ReadOnly[bool]]
    samples: ReadOnly[int]
    seconds: ReadOnly[Number]
    recording_digest: ReadOnly[str]
    at_prior: NotRequired[ReadOnly[Sequence[str]]]
