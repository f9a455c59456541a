"""Opening of a source from the options' values: its kind, checks that options fit together, and the plan."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pkgutil import resolve_name
from typing import Any

from ..chip.config import Config, RateOnlyConfig
from ..errors import CaptureError, UsageError, did_you_mean
from ..origin import Origin
from ..session.plan import Plan
from .kind import Option, Request, SourceKind
from .opened_source import OpenedSource
from .table import DLPF, SOURCES, kinds_for, matching_kinds, unique

# Options of the plan, which a capture fixes.
PLAN_OPTIONS = ("gravity", "gravity_anyway", "model", "target", "tilt_only")
OUTPUT_FOLDER = "folder"


def check_source(values: Mapping[str, Any], given: Mapping[str, str], command: str) -> SourceKind:
    """Return the kind of the selected source, after checks that there is one and that the options belong to it.

    Parameters
    ----------
    values : of all options, by name. given : options on the command line as they were written, by name.

    Raises
    ------
    UsageError : no source, several, one that the command does not take, or options that do not belong to it.
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
    if nearly := did_you_mean(word, [other.word for other in SOURCES if other.option is kind.option and other.word]):
        raise UsageError(f"{kind.option.flag} {word} is not a known source", f"{kind.forms}{nearly}")
    if kind.origin is not Origin.FILE:
        own = _dependent_options([kind])
        _refuse(kind.flag, (option.name for option in _dependent_options(SOURCES) if option not in own), given)
    return kind


def found_sources(command: str) -> list[tuple[str, str]]:
    """List the sources of this computer that a command takes: (option with value, description).

    Of a serial port only the name and the USB description are known: no port is opened.
    """
    return [
        (f"{kind.option.flag} {value}", what)
        for kind in kinds_for(command)
        if kind.found
        for value, what in resolve_name(kind.found)()
    ]


def check_resume_options(given: Mapping[str, str]) -> None:
    """Refuse a source, or an option that the capture fixes, together with --resume.

    Raises
    ------
    UsageError : one was given.
    """
    names = (*(kind.option.name for kind in SOURCES), *_fixed_by_capture(), OUTPUT_FOLDER)
    _refuse("--resume", names, given, ": a session keeps its settings and folder")


def refuse_fixed_options(request: Request) -> None:
    """Refuse an option that a capture fixes, together with that capture.

    Raises
    ------
    UsageError : one was given.
    """
    remedy = "remove it, or use `mpucal calibrate` to fit the capture with other options"
    _refuse(request.kind.flag, _fixed_by_capture(), request.given, ", which the capture fixes", remedy)


def _refuse(
    flag: str, names: Iterable[str], given: Mapping[str, str], why: str = "", remedy: str = "remove it"
) -> None:
    """Raise UsageError if an option of these names was given together with `flag`."""
    for written in (given[name] for name in names if name in given):
        raise UsageError(f"{flag} does not take {written}{why}", remedy, without=written)


def open_source(
    values: Mapping[str, Any], given: Mapping[str, str] | None = None, until_end: bool = False
) -> OpenedSource:
    """Open the source that the options' values select; see check_source.

    Raises
    ------
    UsageError : impossible values. SourceError : the source cannot be opened.
    """
    kind = matching_kinds(values)[0]
    return _open(Request(kind, values, _plan(values, until_end, kind), given or {}))


def reopen_source(words: Mapping[str, Any], plan: Plan) -> OpenedSource:
    """Open the source of a resumed session by the options in its capture's head; see Request.words.

    Raises
    ------
    CaptureError : an unknown kind of source. SourceError : it cannot be opened.
    """
    kinds = matching_kinds(words)
    if not kinds:
        raise CaptureError(
            f"its capture comes from a source that this mpucal does not know ({', '.join(words)})",
            "use the mpucal that recorded it, or `mpucal calibrate` on the folder",
        )
    return _open(Request(kinds[0], words, plan))


def _open(request: Request) -> OpenedSource:
    opened: OpenedSource = resolve_name(request.kind.opener)(request)
    return opened


def one_of(kinds: Iterable[SourceKind]) -> str:
    """Return the remedy for a missing or wrong source."""
    *others, last = (f"{option.flag} {option.metavar}" for option in unique(kind.option for kind in kinds))
    return f"give exactly one of {', '.join(others)} and {last}" if others else f"give {last}"


def _dependent_options(kinds: Iterable[SourceKind]) -> list[Option]:
    """List the options that belong to kinds of source, without those that select them."""
    return unique(option for kind in kinds for option in (*kind.options, *kind.settings))


def _fixed_by_capture() -> tuple[str, ...]:
    return (*(option.name for option in _dependent_options(SOURCES)), *PLAN_OPTIONS)


def _plan(values: Mapping[str, Any], until_end: bool, kind: SourceKind) -> Plan:
    """Build the plan from the options' values, with defaults.

    Raises
    ------
    UsageError : values that no chip has, or that contradict each other.
    """
    usual = Plan(Config())
    configures_chip = DLPF in kind.settings or kind.origin is Origin.FILE
    config = (Config if configures_chip else RateOnlyConfig)(
        int(values.get("accel_range", usual.config.accel_range_g)),
        int(values.get("gyro_range", usual.config.gyro_range_dps)),
        values.get("rate", usual.config.rate_hz),
        values.get("dlpf", usual.config.dlpf),
    )
    model = values.get("model", usual.model)
    if model == "static" and kind.origin is not Origin.FILE:
        what = "a session does not take --model static, which no turn with the gyroscope can verify"
        raise UsageError(what, "remove it, and run `mpucal calibrate DIR --model static` on the session's folder")
    if values.get("tilt_only"):
        if model not in ("auto", "tilt"):
            what = f"--tilt-only does not take --model {model}, which tilts alone do not determine"
            raise UsageError(what, "remove it: tilts are fitted by the model tilt", without="--model")
        model = "tilt"
    aim = {name: values[name] for name in ("target", "tilt_only", "attended", "gravity_anyway") if name in values}
    board = values.get("board") or usual.board
    return Plan(config, values.get("gravity", usual.gravity), model, until_end, board=board, **aim)
