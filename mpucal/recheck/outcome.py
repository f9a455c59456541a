"""Result of a check, as numbers, as a document and as text."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from ..data import AXES, Vector
from ..errors import Abandoned, RefusedError
from ..result.calibration import Calibration
from ..result.correlation import UPPER
from ..result.error_model import MG_PER_MPS2, with_std
from .observed import BETA, DELTA, E, G

Verdict = Literal["still good", "drifted", "remounted", "another sensor", "cannot be told"]
STILL_GOOD: Verdict = "still good"
DRIFTED: Verdict = "drifted"
REMOUNTED: Verdict = "remounted"
ANOTHER_SENSOR: Verdict = "another sensor"
CANNOT_BE_TOLD: Verdict = "cannot be told"
CORRECTED_BY_BIASES = ("nothing", "bias", "gyroscope's bias", "temperature")


@dataclass(frozen=True)
class Change:
    """Change of one quantity: values of x, y, z with standard deviations, in `unit`."""

    unit: str
    value: tuple[float, ...]
    std: tuple[float, ...]

    @classmethod
    def of(cls, unit: str, value: Vector, covariance: Vector, scale: float) -> Change:
        """Return the change from a value (3,) and its covariance (3, 3), both times `scale`."""
        std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        return cls(unit, tuple((scale * value).tolist()), tuple((scale * std).tolist()))

    def text(self) -> str:
        """Return the values with standard deviations, without the unit."""
        return ", ".join(
            f"{axis} {with_std(value, std)}" for axis, value, std in zip(AXES, self.value, self.std, strict=True)
        )


@dataclass(frozen=True, eq=False, repr=False)
class CheckResult:  # noqa: PLW1641 - arrays have no hash either
    """Result of `mpucal check`; two are equal if their check.json is the same.

    Attributes
    ----------
    verdict : still good, drifted, remounted, another sensor, or cannot be told.
    what : nothing, bias, scale, mount, gyroscope's bias, gyroscope's scale, temperature, noise or another sensor.
    message : the verdict in a sentence. remedy : what to do next; empty if nothing is to be done.
    changes : by name (bias, scale, mount, gyroscope's bias, gyroscope's scale), estimated for this hypothesis.
    or_also : hypotheses that explain the observations nearly as well.
    probability : share of unchanged sensors that show as much; None where it was not computed.
    log_odds : log odds of each hypothesis against "nothing".
    temperature_change_c : since the calibration; None: not known. temperature_explains : True if that explains the
        observations, by b_a(T) or the data sheet; None where it is not known or nothing changed.
    orientations : number of orientations seen, 20 deg apart. seconds : length of the recording.
    theta : (23,), covariance : (23, 23), the estimate, see `mpucal.recheck.observed`; None: there is none.
    """

    verdict: Verdict
    what: str
    message: str
    remedy: str = ""
    changes: Mapping[str, Change] | None = None
    or_also: tuple[str, ...] = ()
    probability: float | None = None
    log_odds: Mapping[str, float] | None = None
    temperature_change_c: float | None = None
    temperature_explains: bool | None = None
    orientations: int = 0
    seconds: float = 0.0
    theta: Vector | None = None
    covariance: Vector | None = None

    def __eq__(self, other: object) -> bool:
        return self.document() == other.document() if isinstance(other, CheckResult) else NotImplemented

    def __repr__(self) -> str:
        return f"<CheckResult: {self.verdict}; {self.message}>"

    @property
    def exit_code(self) -> int:
        """Exit code of `mpucal check`: 0 still good, 5 changed, 4 cannot be told."""
        codes = {STILL_GOOD: 0, CANNOT_BE_TOLD: Abandoned.exit_code}
        return codes.get(self.verdict, RefusedError.exit_code)

    @property
    def only_biases(self) -> bool:
        """True if new biases are all that the calibration needs, or nothing is."""
        return self.verdict in (STILL_GOOD, DRIFTED) and self.what in CORRECTED_BY_BIASES

    def document(self) -> dict[str, Any]:
        """Return the content of check.json, in JSON's own types."""
        left_out = ("theta", "covariance", "changes")
        values = {key: value for key, value in vars(self).items() if key not in left_out}
        changes = {name: asdict(change) for name, change in (self.changes or {}).items()}
        return {"format": "mpucal.check", "version": 1, **values, "or_also": list(self.or_also), "changes": changes}

    def page(self) -> str:
        """Return the text that `mpucal check` prints."""
        lines = [f"{self.verdict[0].upper()}{self.verdict[1:]}: {self.message}."]
        lines += [f"To do: {self.remedy}."] if self.remedy else []
        lines += ["", *(_row(name, change) for name, change in self.changes.items())] if self.changes else []
        if self.probability is not None:
            lines += ["", f"An unchanged sensor shows as much in {100.0 * self.probability:.3g} % of checks."]
        lines += [f"Orientations: {self.orientations} in {self.seconds:.0f} s."] if self.seconds else []
        return "\n".join(lines)


def changes_of(calibration: Calibration, theta: Vector, covariance: Vector) -> dict[str, Change]:
    """Return the changes by theta (23,) and its covariance: bias [mg], scale factors [%], mount [deg], ..."""
    D, degrees = calibration.D, float(np.degrees(1.0))
    to_turn = np.zeros((3, 9))
    for axis, (i, j) in enumerate(((2, 1), (0, 2), (1, 0))):
        to_turn[axis, 3 * i + j], to_turn[axis, 3 * j + i] = 0.5, -0.5
    diagonal = [0, 4, 8]
    of_E, on_G = covariance[E, E], np.flatnonzero(UPPER[0] == UPPER[1])
    of_G = covariance[G, G][np.ix_(on_G, on_G)]
    return {
        "bias": Change.of("mg", D @ theta[BETA], D @ covariance[BETA, BETA] @ D.T, MG_PER_MPS2),
        "scale": Change.of("%", theta[E][diagonal], of_E[np.ix_(diagonal, diagonal)], 100.0),
        "mount": Change.of("deg", to_turn @ theta[E], to_turn @ of_E @ to_turn.T, degrees),
        "gyroscope's bias": Change.of("deg/s", theta[DELTA], covariance[DELTA, DELTA], degrees),
        "gyroscope's scale": Change.of("%", theta[G][on_G], of_G, 100.0),
    }


def _row(name: str, change: Change) -> str:
    return f"  {f'{name}, {change.unit}':<26}{change.text()}"
