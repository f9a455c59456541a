"""Options that several commands share, and where their values fit together."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

import click
from click.core import ParameterSource

from ..arguments import LEAST_GRAVITY_MPS2, LEAST_ON_EARTH_MPS2, MOST_GRAVITY_MPS2, MOST_ON_EARTH_MPS2
from ..calibration import MODELS
from ..chip.config import Config
from ..data import STANDARD_GRAVITY_MPS2
from ..errors import UsageError
from ..session.aims import AIMS, NORMAL
from ..sources import opening
from ..sources.kind import Option, SourceKind
from ..sources.table import SOURCES, kinds_for, unique

F = TypeVar("F", bound=Callable[..., Any])


class Parsed(click.ParamType[Any]):
    """A value of the text that a person gives, by the parser of its option."""

    name = "text"

    def __init__(self, parse: Callable[[str], Any]) -> None:
        self._parse = parse

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The value; a default is one already."""
        if not isinstance(value, str):
            return value
        try:
            return self._parse(value)
        except ValueError as error:
            self.fail(str(error), param, ctx)


class Finite(click.FloatRange):
    """A number within a range, and no nan, which every range admits."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number."""
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value!r} is no finite number.", param, ctx)
        return float(number)


ABOVE_ZERO = Finite(min=0.0, min_open=True)


def local_gravity(text: str) -> float:
    """A local gravity in m/s² as text."""
    try:
        gravity = float(text)
    except ValueError:
        gravity = math.nan
    if not LEAST_GRAVITY_MPS2 <= gravity <= MOST_GRAVITY_MPS2:
        raise ValueError(f"{text!r} is no local gravity: give it in m/s², about 9.81.")
    return gravity


def check_gravity(gravity: float, anyway: bool) -> None:
    """Refuse, before a person turns a board, a gravity that no place on Earth has."""
    if anyway or LEAST_ON_EARTH_MPS2 <= gravity <= MOST_ON_EARTH_MPS2:
        return
    units = {"cm/s²": 0.01, "g": STANDARD_GRAVITY_MPS2, "mg": STANDARD_GRAVITY_MPS2 / 1e3, "ft/s²": 0.3048}
    meant = [
        f" In {unit} it is --gravity {gravity * factor:.5g}."
        for unit, factor in units.items()
        if LEAST_ON_EARTH_MPS2 <= gravity * factor <= MOST_ON_EARTH_MPS2
    ]
    raise click.UsageError(
        f"no place on Earth has a gravity of {gravity:g} m/s² ({LEAST_ON_EARTH_MPS2:g} to {MOST_ON_EARTH_MPS2:g})."
        f"{''.join(meant)} Where it is meant, add --gravity-anyway."
    )


def source_options(name: str, settings: bool = True) -> Callable[[F], F]:
    """The sources that the command `name` takes, and what belongs to them; the others are there to be refused.

    Parameters
    ----------
    settings : how the sensor is set, too.
    """
    taken = kinds_for(name)
    belonging = [option for kind in taken for option in kind.options]
    if settings:
        belonging += [option for kind in taken for option in kind.settings]

    def decorate(command: F) -> F:
        for option in reversed(unique(belonging)):
            command = _declared(option, option.help)(command)
        for option in reversed(unique(kind.option for kind in SOURCES)):
            forms = [kind.forms for kind in taken if kind.option is option]
            command = _declared(option, _sentence(", or ".join(forms)), hidden=not forms)(command)
        return command

    return decorate


def _declared(option: Option, text: str, hidden: bool = False) -> Callable[[F], F]:
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
    """A form such as udp:PORT keeps its small letter, as it is typed."""
    first, _, _ = words.partition(" ")
    return f"{words if ':' in first else words[:1].upper() + words[1:]}."


def fit_options(command: F) -> F:
    """--gravity, --gravity-anyway and --model."""
    for option in (
        click.option("--model", type=click.Choice(MODELS), default="auto", show_default=True, help="What to estimate."),
        click.option(
            "--gravity",
            metavar="MPS2",
            type=Parsed(local_gravity),
            default=STANDARD_GRAVITY_MPS2,
            show_default=True,
            help="Local gravity [m/s²].",
        ),
        click.option("--gravity-anyway", is_flag=True, help="Accept a gravity that no place on Earth has."),
    ):
        command = option(command)
    return command


def aim_options(command: F) -> F:
    """--target and --tilt-only."""
    for option in (
        click.option(
            "--tilt-only",
            is_flag=True,
            help="For boards that cannot be turned upside down: use tilts only; parameters that tilts do not show keep "
            "their defaults.",
        ),
        click.option(
            "--target",
            type=click.Choice(tuple(AIMS)),
            default=NORMAL,
            show_default=True,
            help="Required accuracy (1 sigma): normal is 1 mg of bias, 0.1 % of scale factor error, 0.05 deg of "
            "misalignment.",
        ),
    ):
        command = option(command)
    return command


def check_gyroscope(config: Config) -> None:
    """What is to be calibrated or examined is measured with the gyroscope, too.

    Raises
    ------
    UsageError : it is left out.
    """
    if config.accel_only:
        raise UsageError(
            f"at {config.rate_hz:g} Hz a chip measures with its accelerometer alone, and this needs the gyroscope",
            f"take --rate 1000 or less; `mpucal record` and `mpucal stream` do with --rate {config.rate_hz:g}",
        )


def given() -> dict[str, str]:
    """The options of the present command that a person wrote: name to spelling."""
    context = click.get_current_context()
    return {
        str(option.name): option.opts[0]
        for option in context.command.params
        if isinstance(option, click.Option)
        and context.get_parameter_source(str(option.name)) is ParameterSource.COMMANDLINE
    }


def check_source(context: click.Context) -> SourceKind:
    """One source that the command takes, and nothing beside it that belongs to another; see sources.opening.

    Raises
    ------
    UsageError : none, several, or options that do not fit the source.
    """
    return opening.check_source(context.params, given(), str(context.command.name))
