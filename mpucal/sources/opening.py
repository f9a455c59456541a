"""From the values of the options to an open source: which kind is meant, whether they fit together, what to do."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pkgutil import resolve_name
from typing import Any

from ..chip.config import Config, RateOnlyConfig
from ..errors import CaptureError, UsageError, meant
from ..session.plan import Plan
from .kind import Delivery, Option, Request, SourceKind
from .opened_source import OpenedSource
from .table import DLPF, SOURCES, kinds_for, matching_kinds, unique

# what a person may choose of a plan; a capture holds it
OF_THE_PLAN = ("gravity", "gravity_anyway", "model", "target", "tilt_only")
OUTPUT_FOLDER = "folder"


def check_source(values: Mapping[str, Any], given: Mapping[str, str], command: str) -> SourceKind:
    """The one source that is named, with nothing beside it that belongs to another.

    Parameters
    ----------
    values : of all options, by name. given : the options that a person wrote, by name, as they were written.

    Raises
    ------
    UsageError : none, several, one that the command does not take, or options that do not fit it.
    """
    kinds = matching_kinds(values)
    if len(kinds) != 1:
        together = " and ".join(kind.option.flag for kind in kinds)
        what = f"{together} were given together" if kinds else "no source was given"
        raise UsageError(what, one_of(kinds_for(command)))
    kind = kinds[0]
    if command not in kind.commands:
        remedy = "; ".join(filter(None, (one_of(kinds_for(command)), kind.instead)))
        raise UsageError(f"{kind.flag} was given, and `mpucal {command}` does not take it", remedy)
    word = str(values[kind.option.name]).partition(":")[0]
    if nearly := meant(word, [other.word for other in SOURCES if other.option is kind.option and other.word]):
        raise UsageError(f"{kind.option.flag} {word} names no source", f"{kind.forms}{nearly}")
    if kind.delivers is not Delivery.CAPTURE:
        for option in _beside(SOURCES):
            if option.name in given and option not in _beside([kind]):
                what = f"{given[option.name]} was given beside {kind.flag}, which has none"
                raise UsageError(what, "leave it out")
    return kind


def check_resume_options(given: Mapping[str, str]) -> None:
    """Beside --resume neither a source nor what its capture fixes.

    Raises
    ------
    UsageError : it was given.
    """
    for name in (*(kind.option.name for kind in SOURCES), *_fixed_by_capture(), OUTPUT_FOLDER):
        if name in given:
            what = f"{given[name]} was given beside --resume, and a session goes on as it began, in its folder"
            raise UsageError(what, "leave it out")


def refuse_fixed_options(request: Request) -> None:
    """Beside a capture, nothing that it fixes.

    Raises
    ------
    UsageError : it was given.
    """
    for name in _fixed_by_capture():
        if name in request.given:
            raise UsageError(
                f"{request.given[name]} was given beside {request.kind.flag}, and the capture fixes it",
                "leave it out, or use `mpucal calibrate` to fit the capture differently",
            )


def open_source(
    values: Mapping[str, Any], given: Mapping[str, str] | None = None, until_end: bool = False
) -> OpenedSource:
    """The source that the options' values name; see check_source.

    Raises
    ------
    UsageError : values that name no such source. SourceError : it cannot be opened.
    """
    kind = matching_kinds(values)[0]
    opened: OpenedSource = resolve_name(kind.opener)(
        Request(kind, values, _plan(values, until_end, _of_a_chip(kind)), given or {})
    )
    return opened


def contents(values: Mapping[str, Any]) -> dict[str, Any]:
    """What the sensor that the options' values name holds now, in JSON's own types; nothing is set up or written.

    Raises
    ------
    UsageError : values that name no such source. SourceError : it cannot be opened, or does not answer.
    """
    source: Any = open_source(values)
    facts: dict[str, Any] = source.contents()
    return facts


def reopen_source(words: Mapping[str, Any], plan: Plan) -> OpenedSource:
    """The source of a session that goes on, by the words in its capture's head; see Request.words.

    Raises
    ------
    CaptureError : no such kind of source is known. SourceError : it cannot be opened.
    """
    kinds = matching_kinds(words)
    if not kinds:
        raise CaptureError(
            f"its capture was made of a source that this mpucal does not know ({', '.join(words)})",
            "use the mpucal that recorded it, or `mpucal calibrate` on the folder",
        )
    opened: OpenedSource = resolve_name(kinds[0].opener)(Request(kinds[0], words, plan))
    return opened


def one_of(kinds: Iterable[SourceKind]) -> str:
    """What to do where none or the wrong one was given."""
    *others, last = (f"{option.flag} {option.metavar}" for option in unique(kind.option for kind in kinds))
    return f"give exactly one of {', '.join(others)} and {last}" if others else f"give {last}"


def _beside(kinds: Iterable[SourceKind]) -> list[Option]:
    """The options that belong to some kinds of source, besides the ones that name these."""
    return unique(option for kind in kinds for option in (*kind.options, *kind.settings))


def _fixed_by_capture() -> tuple[str, ...]:
    return (*(option.name for option in _beside(SOURCES)), *OF_THE_PLAN)


def _of_a_chip(kind: SourceKind) -> bool:
    """Whether more than its rate can be set."""
    return DLPF in kind.settings or kind.delivers is Delivery.CAPTURE


def _plan(values: Mapping[str, Any], until_end: bool, of_a_chip: bool) -> Plan:
    """What the options' values ask for; what they leave out is as usual.

    Raises
    ------
    UsageError : values that a chip does not have, or that contradict each other.
    """
    usual = Plan(Config())
    config = (Config if of_a_chip else RateOnlyConfig)(
        int(values.get("accel_range", usual.config.accel_range_g)),
        int(values.get("gyro_range", usual.config.gyro_range_dps)),
        values.get("rate", usual.config.rate_hz),
        values.get("dlpf", usual.config.dlpf),
    )
    model = values.get("model", usual.model)
    if values.get("tilt_only"):
        if model not in ("auto", "tilt"):
            what = f"--model {model} was given beside --tilt-only, and tilts alone do not determine it"
            raise UsageError(what, "leave it out: tilts are fitted by the model tilt")
        model = "tilt"
    aim = {name: values[name] for name in ("target", "tilt_only", "attended", "gravity_anyway") if name in values}
    return Plan(config, values.get("gravity", usual.gravity), model, until_end, **aim)
