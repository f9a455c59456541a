"""The reasons against a calibration, by the table in reasons.toml: codes, sentences and remedies.

A check (calibration/checks/, session/live_verification.py) decides whether a reason holds, and fills its numbers into
one of its sentences: `reason("gyro_clipped", "samples", refuse=False, count=12, share=0.01)`. A new reason is a table
in reasons.toml and a check. `python -m tools.make pages` makes docs/reasons.md from reasons.toml.
"""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, Required, Self, TypedDict

from .origin import Origin, name_thing

if TYPE_CHECKING:
    # part of every type checker; result/keys.py takes it from here
    from typing_extensions import ReadOnly as ReadOnly  # noqa: PLC0414
else:

    class ReadOnly:
        """Stand-in for typing.ReadOnly of Python 3.13: the type itself."""

        def __class_getitem__(cls, kind: Any) -> Any:
            return kind


class ReasonFound(TypedDict, total=False):
    """Entry of quality.reasons in calibration.json."""

    code: Required[ReadOnly[Annotated[str, {"pattern": "^[a-z0-9_]{1,64}$"}]]]
    message: Required[ReadOnly[Annotated[str, "what is wrong, and what to do"]]]
    remedy: ReadOnly[Annotated[str, "what to do"]]


@dataclass(frozen=True)
class Reason:
    """Reason against a calibration.

    Attributes
    ----------
    code : key of KINDS. what, remedy : a clause each: what is wrong, what to do. refuse : the calibration is refused.
    span : s since the recording began, in which the sensor changed; None for other reasons.
    """

    code: str
    what: str
    remedy: str
    refuse: bool
    span: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if self.code not in KINDS:
            raise ValueError(f"there is no reason {self.code!r} in mpucal/reasons.toml")

    @property
    def message(self) -> str:
        """Return both clauses as one sentence, without its full stop."""
        return f"{self.what}; {self.remedy}"

    def about(self, origin: Origin) -> Reason:
        """Return the reason in the words for samples of `origin`."""
        return replace(self, what=name_thing(self.what, origin), remedy=name_thing(self.remedy, origin))

    def document(self) -> ReasonFound:
        """Return the entry of quality.reasons in calibration.json."""
        return {"code": self.code, "message": self.message, "remedy": self.remedy}


class Sentence(NamedTuple):
    """Sentence of a reason, with {places} for numbers; `refuse` is None if the check decides.

    divides : the sensor is not the same before {begin} and after {end}, and a part of the recording may do.
    """

    what: str
    remedy: str
    refuse: bool | None = None
    divides: bool = False


class Kind(NamedTuple):
    """Kind of reasons, with one code; its attributes are those of reasons.toml, with `sentences` by their names."""

    meaning: str
    sentences: Mapping[str, Sentence]
    reproduce: str
    refused_when: str = ""
    turn_again: bool = False
    of_the_sensor: bool = False
    explained_by: Collection[str] = ()

    @classmethod
    def of(cls, rows: Mapping[str, Any]) -> Self:
        """Return the kind of a table of reasons.toml, in which the tables are the sentences."""
        own, usual = dict(rows), {key: rows[key] for key in Sentence.__match_args__ if key in rows}
        names = [name for name, row in rows.items() if isinstance(row, dict)]
        sentences = {name: Sentence(**{**usual, **own.pop(name)}) for name in names}
        return cls(sentences=sentences, **{key: value for key, value in own.items() if key not in usual})

    @property
    def refuses(self) -> str:
        """Return "always", "never" or "depends"."""
        refusals = {sentence.refuse for sentence in self.sentences.values()}
        if self.refused_when or len(refusals) > 1 or None in refusals:
            return "depends"
        return "always" if True in refusals else "never"


def reason(code: str, sentence: str, refuse: bool | None = None, **numbers: Any) -> Reason:
    """Return a reason, with `numbers` in the places of its sentence.

    Raises
    ------
    KeyError : unknown code, sentence or place. ValueError : `refuse` is given although the table decides, or missing.
    """
    row = KINDS[code].sentences[sentence]
    if (refuse is None) == (row.refuse is None):
        raise ValueError(f"{code}, {sentence}: either the table or the check decides on a refusal, not both")
    decided = bool(refuse if row.refuse is None else row.refuse)
    span = (float(numbers["begin"]), float(numbers["end"])) if row.divides else None
    return Reason(code, row.what.format(**numbers), row.remedy.format(**numbers), decided, span)


def is_explained(code: str, codes: Collection[str]) -> bool:
    """Return True if a reason among others, by their codes, is their consequence, and is not told."""
    return any(other in codes for other in KINDS[code].explained_by)


# after a reason against the gyroscope, or against a part of the recording, where an estimate is possible without it
OF_RESTS = ": D and b_a are estimated from the rests alone, in the accelerometer's own axes"
OF_A_PART = ": D and b_a are estimated from what was recorded {when} {seconds:.0f} s alone"

_TABLE = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
KINDS: Mapping[str, Kind] = {code: Kind.of(rows) for code, rows in _TABLE.items()}
