"""Options that several commands share, the types of their values, and the check of a gravity."""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable
from typing import Any

import click
from click.core import ParameterSource

from ..arguments import LEAST_GRAVITY_MPS2, LEAST_ON_EARTH_MPS2, MOST_GRAVITY_MPS2, MOST_ON_EARTH_MPS2
from ..calibration import MODELS
from ..data import STANDARD_GRAVITY_MPS2
from ..files.tables.units import QUANTITIES
from ..sources.kind import Option
from . import typed_words, with_option
from .common import Decorator, together


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


def option_of(option: Option, hidden: bool = False) -> Decorator:
    """Return the click option for a row of a table."""
    bare: dict[str, Any] = {} if option.bare is None else {"is_flag": False, "flag_value": option.bare}
    parsed = option.parse if isinstance(option.parse, click.ParamType) else Parsed(option.parse)
    return click.option(
        option.flag,
        option.name,
        metavar=option.metavar,
        type=click.Choice(option.choices) if option.choices else parsed,
        default=option.default,
        show_default=option.default is not None,
        help=option.help,
        hidden=hidden,
        **bare,
    )


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
    suggestions = [
        f" In {unit} it is `mpucal {shlex.join(with_option(typed_words(), '--gravity', f'{si:.6g}'))}`."
        for unit, size in QUANTITIES["acc"].items()
        if LEAST_ON_EARTH_MPS2 <= (si := gravity * size) <= MOST_ON_EARTH_MPS2
    ]
    raise click.UsageError(
        f"no place on Earth has a gravity of {gravity:g} m/s² ({LEAST_ON_EARTH_MPS2:g} to {MOST_ON_EARTH_MPS2:g})."
        f"{''.join(suggestions)} To use it all the same, add --gravity-anyway."
    )


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


def given_options() -> dict[str, str]:
    """Return the options that the command line holds: name to spelling."""
    context = click.get_current_context()
    return {
        str(option.name): option.opts[0]
        for option in context.command.params
        if isinstance(option, click.Option)
        and context.get_parameter_source(str(option.name)) is ParameterSource.COMMANDLINE
    }
