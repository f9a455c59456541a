"""Options that several commands share, and checks of their values together."""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from ..arguments import LEAST_GRAVITY_MPS2, LEAST_ON_EARTH_MPS2, MOST_GRAVITY_MPS2, MOST_ON_EARTH_MPS2
from ..calibration import MODELS
from ..data import STANDARD_GRAVITY_MPS2
from ..errors import UsageError
from ..session.aims import AIMS, NORMAL
from ..sources import opening
from ..sources.kind import Option, SourceKind
from ..sources.table import SOURCES, kinds_for, matching_kinds, unique
from . import typed_words, with_option
from .arguments import Decorator, together


class Parsed(click.ParamType[Any]):
    """Parameter type whose values are parsed by a function that raises ValueError."""

    name = "text"

    def __init__(self, parse: Callable[[str], Any]) -> None:
        self._parse = parse

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the parsed text; a default value is parsed already."""
        if not isinstance(value, str):
            return value
        try:
            return self._parse(value)
        except ValueError as error:
            self.fail(str(error), param, ctx)


class Finite(click.FloatRange):
    """Finite number within a range; click's FloatRange accepts nan."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number."""
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value!r} is not a finite number.", param, ctx)
        return float(number)


ABOVE_ZERO = Finite(min=0.0, min_open=True)


def parse_gravity(text: str) -> float:
    """Parse a local gravity in m/s²."""
    try:
        gravity = float(text)
    except ValueError:
        gravity = math.nan
    if not LEAST_GRAVITY_MPS2 <= gravity <= MOST_GRAVITY_MPS2:
        raise ValueError(f"{text!r} is not a local gravity: give it in m/s², about 9.81.")
    return gravity


def check_gravity(gravity: float, anyway: bool) -> None:
    """Raise UsageError for a gravity outside the range found on Earth, before a person turns a board."""
    if anyway or LEAST_ON_EARTH_MPS2 <= gravity <= MOST_ON_EARTH_MPS2:
        return
    units = {"cm/s²": 0.01, "g": STANDARD_GRAVITY_MPS2, "mg": STANDARD_GRAVITY_MPS2 / 1e3, "ft/s²": 0.3048}
    suggestions = [
        f" In {unit} it is `mpucal {shlex.join(with_option(typed_words(), '--gravity', f'{gravity * factor:.6g}'))}`."
        for unit, factor in units.items()
        if LEAST_ON_EARTH_MPS2 <= gravity * factor <= MOST_ON_EARTH_MPS2
    ]
    raise click.UsageError(
        f"no place on Earth has a gravity of {gravity:g} m/s² ({LEAST_ON_EARTH_MPS2:g} to {MOST_ON_EARTH_MPS2:g})."
        f"{''.join(suggestions)} To use it all the same, add --gravity-anyway."
    )


def source_options(name: str, settings: bool = True) -> Decorator:
    """Return the options of the sources that the command `name` takes; those of other sources are hidden.

    Hidden options are parsed, so that they are refused with a reason.

    Parameters
    ----------
    settings : add the settings of the sensor, too.
    """
    taken = kinds_for(name)
    belonging = [option for kind in taken for option in kind.options]
    if settings:
        belonging += [option for kind in taken for option in kind.settings]
    declared = []
    for option in unique(kind.option for kind in SOURCES):
        forms = [kind.forms for kind in taken if kind.option is option]
        declared.append(_click_option(option, _sentence(", or ".join(forms)), hidden=not forms))
    declared += [_click_option(option, option.help) for option in unique(belonging)]
    return together(*declared)


def _click_option(option: Option, text: str, hidden: bool = False) -> Decorator:
    bare: dict[str, Any] = {} if option.bare is None else {"is_flag": False, "flag_value": option.bare}
    return click.option(
        option.flag,
        option.name,
        metavar=option.metavar,
        type=click.Choice(option.choices) if option.choices else Parsed(option.parse),
        default=option.default,
        show_default=option.default is not None,
        help=text,
        hidden=hidden,
        **bare,
    )


def _sentence(words: str) -> str:
    """Return a sentence; a form such as udp:PORT keeps its small letter, as it is typed."""
    first, _, _ = words.partition(" ")
    return f"{words if ':' in first else words[:1].upper() + words[1:]}."


fit_options = together(
    click.option("--gravity-anyway", is_flag=True, help="Allow a gravity outside the range found on Earth."),
    click.option(
        "--gravity",
        metavar="MPS2",
        type=Parsed(parse_gravity),
        default=STANDARD_GRAVITY_MPS2,
        show_default=True,
        help="Local gravity [m/s²].",
    ),
    click.option(
        "--model", type=click.Choice(MODELS), default="auto", show_default=True, help="Parameters to estimate."
    ),
)
_STD = AIMS[NORMAL].target
aim_options = together(
    click.option(
        "--target",
        type=click.Choice(tuple(AIMS)),
        default=NORMAL,
        show_default=True,
        help=f"Required accuracy (1 sigma): {NORMAL} is {_STD.bias_mg:g} mg of bias, {_STD.gain_pct:g} % of scale"
        f" factor error, {_STD.misalignment_deg:g} deg of misalignment.",
    ),
    click.option(
        "--tilt-only",
        is_flag=True,
        help="For boards that cannot be turned upside down: use tilts only; parameters that tilts do not show keep "
        "their defaults.",
    ),
)


def given_options() -> dict[str, str]:
    """Return the options that the command line holds: name to spelling."""
    context = click.get_current_context()
    return {
        str(option.name): option.opts[0]
        for option in context.command.params
        if isinstance(option, click.Option)
        and context.get_parameter_source(str(option.name)) is ParameterSource.COMMANDLINE
    }


def check_input(file: Path | None, options: Mapping[str, Any], name: str) -> list[SourceKind]:
    """Return the kinds of sources that are given; UsageError unless it is either a file or one source.

    Parameters
    ----------
    name : of the command.
    """
    kinds = matching_kinds(options)
    given = [*(["a file"] if file is not None else []), *(kind.option.flag for kind in kinds)]
    if len(given) != 1:
        what = f"{' and '.join(given)} were given together" if given else "neither a file nor a source was given"
        raise UsageError(what, f"give a file, or {opening.one_of(kinds_for(name))}")
    return kinds


def check_source(context: click.Context) -> SourceKind:
    """Return the kind of the source that is given; see sources.opening.

    Raises
    ------
    UsageError : no source or several were given, or an option does not belong to it.
    """
    command = str(context.command.name)
    if not matching_kinds(context.params) and not context.params.get("json_events"):
        _list_sources(command, shlex.join(typed_words()))
    return opening.check_source(context.params, given_options(), command)


def _list_sources(command: str, words: str) -> None:
    """Print the sources that there are, and the simulated chip, each with the whole command that takes it."""
    found = opening.found_sources(command)
    heading = "Found on this computer:" if found else "No sensor was found on this computer. To try it without:"
    click.echo(heading, err=True)
    lines = [(f"mpucal {words} {option}", what) for option, what in (*found, ("--bus sim", "the simulated chip"))]
    width = max(len(line) for line, _ in lines)
    for line, what in lines:
        click.echo(f"  {line:<{width}}  {what}", err=True)
