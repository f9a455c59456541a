"""The keys of `fit` and `quality` as types: what a type checker knows of these mappings, which nobody changes.

They are those that `calibrate` gives. Of a config blob `quality` is empty, and `fit` has the gravity alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, NotRequired, TypedDict

from ..reasons import ReasonFound

if TYPE_CHECKING:
    from typing_extensions import ReadOnly  # which type checkers bring with them

Verdict = Literal["good", "usable", "refused"]
Number = float | None  # NaN or None (null in the file) where unknown


class Magnitude(TypedDict):
    """|a| of all samples [m/s^2]."""

    median: ReadOnly[Number]
    mean: ReadOnly[Number]
    std: ReadOnly[Number]


class ErrorStd(TypedDict):
    """Standard uncertainty of a calibrated measurement over all directions [m/s^2, deg], and what it rests on."""

    rms: ReadOnly[Number]
    magnitude: ReadOnly[Number]
    direction_deg: ReadOnly[Number]
    model: ReadOnly[Number]
    without_a_time: ReadOnly[Number]
    without_a_side: ReadOnly[Number]
    decided_by: ReadOnly[Literal["model", "time", "side", "change"] | None]


class Verification(TypedDict):
    """What new orientations said; `agrees` None where none was shown."""

    agrees: ReadOnly[bool | None]
    orientations: ReadOnly[Sequence[Mapping[str, Any]]]


class Quality(TypedDict):
    """The `quality` of calibration.json; `verification` only of a session that has verified."""

    verdict: ReadOnly[Verdict]
    reasons: ReadOnly[Sequence[ReasonFound]]
    magnitude_before: ReadOnly[Magnitude]
    magnitude_after: ReadOnly[Magnitude]
    error_std: ReadOnly[ErrorStd]
    verification: NotRequired[ReadOnly[Verification]]


class Fit(TypedDict):
    """The `fit` of calibration.json: the model, why that one, and what its estimation was."""

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
