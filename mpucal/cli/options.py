"""Options that several commands share, and where their values fit together."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import click
from click.core import ParameterSource

from ..calibration import MODELS
from ..chip.config import Config
from ..chip.registers import DLPF_CODES
from ..data import STANDARD_GRAVITY_MPS2
from ..errors import UsageError
from ..session.aims import AIMS, NORMAL

TLOG = ".tlog"

F = TypeVar("F", bound=Callable[..., Any])

ACCEL_RANGES_G, GYRO_RANGES_DPS = ("2", "4", "8", "16"), ("250", "500", "1000", "2000")

# what a capture fixes: none of it may be given beside --replay
FIXED_BY_CAPTURE = (
    "address",
    "rate",
    "dlpf",
    "accel_range",
    "gyro_range",
    "seed",
    "gravity",
    "model",
    "target",
    "tilt_only",
    "system",
    "signing_key",
)
SOURCES = ("bus", "serial", "mavlink", "replay")
SIMULATED = "sim"
# what only one kind of source has
OF_A_BUS, OF_A_VEHICLE = ("address", "dlpf", "accel_range", "gyro_range", "seed"), ("system", "signing_key")


class Integer(click.ParamType[int]):
    """A whole number, decimal or 0x hexadecimal."""

    name = "integer"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """The number of its text."""
        try:
            return int(str(value), 0)
        except ValueError:
            self.fail(f"{value!r} is no whole number.", param, ctx)


class BusName(click.ParamType[str]):
    """An adapter by its path or number, or the simulated chip; a number becomes the path."""

    name = "text"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """The path, or the words of the simulated chip."""
        if not value:
            self.fail("no bus is named: give /dev/i2c-N, or sim.", param, ctx)
        return f"/dev/i2c-{value}" if value.isdecimal() else str(value)


class Gravity(click.ParamType[float]):
    """A local gravity in m/s²."""

    name = "float"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number of its text."""
        try:
            gravity = float(value)
        except ValueError:
            gravity = math.nan
        if not 0.0 < gravity < math.inf:
            self.fail(f"{value!r} is no local gravity: give it in m/s², about 9.81.", param, ctx)
        return gravity


def source_options(command: F) -> F:
    """--bus, --serial, --mavlink or --replay, and how the sensor is set."""
    for option in reversed(
        (
            click.option(
                "--bus",
                metavar="BUS",
                type=BusName(),
                help="/dev/i2c-N or N, or sim[:key=value,...] for the simulated chip.",
            ),
            click.option(
                "--serial",
                metavar="PORT[:BAUD]",
                is_flag=False,
                flag_value="",
                help="A board with the bridge's firmware: /dev/ttyX or COMn, or a URL such as socket://HOST:PORT.",
            ),
            click.option(
                "--mavlink",
                metavar="URL",
                help="udp:[HOST:]PORT, udpout:HOST:PORT, tcp:HOST:PORT, /dev/ttyX[:BAUD], or sim[:key=value,...].",
            ),
            click.option("--replay", metavar="FILE", type=click.Path(path_type=Path), help="Run a capture again."),
            click.option("--address", type=Integer(), help="I2C address; by default 0x68, then 0x69."),
            click.option(
                "--rate",
                metavar="HZ",
                type=float,
                default=200.0,
                show_default=True,
                help="Samples a second, to 1000; 4000 records or streams an MPU-6500's accelerometer alone.",
            ),
            click.option(
                "--dlpf",
                metavar="CODE",
                type=click.IntRange(DLPF_CODES[0], DLPF_CODES[-1]),
                default=3,
                show_default=True,
                help="Low-pass filter: 1 (184 Hz) to 6 (5 Hz); 0 (260 Hz) of an MPU-6050 only.",
            ),
            click.option(
                "--accel-range", type=click.Choice(ACCEL_RANGES_G), default="4", show_default=True, help="±g."
            ),
            click.option(
                "--gyro-range",
                type=click.Choice(GYRO_RANGES_DPS),
                default="500",
                show_default=True,
                help="±deg/s.",
            ),
            click.option("--seed", type=click.IntRange(min=0), help="Which simulated sensor and hand."),
            click.option("--system", metavar="N", type=click.IntRange(1, 255), help="Which vehicle, if several."),
            click.option(
                "--signing-key",
                metavar="FILE",
                type=click.Path(path_type=Path),
                help="MAVLink 2 key: 32 bytes, 64 hexadecimal digits, or a passphrase.",
            ),
        )
    ):
        command = option(command)
    return command


def fit_options(command: F) -> F:
    """--gravity and --model."""
    for option in (
        click.option("--model", type=click.Choice(MODELS), default="auto", show_default=True, help="What to estimate."),
        click.option(
            "--gravity", type=Gravity(), default=STANDARD_GRAVITY_MPS2, show_default=True, help="Local gravity [m/s²]."
        ),
    ):
        command = option(command)
    return command


def aim_options(command: F) -> F:
    """--target and --tilt-only."""
    for option in (
        click.option(
            "--tilt-only", is_flag=True, help="Of what cannot be turned over: ask for tilts, claim what they show."
        ),
        click.option(
            "--target",
            type=click.Choice(tuple(AIMS)),
            default=NORMAL,
            show_default=True,
            help="How well to know it: normal is 1 mg of bias, 0.1 % of gain, 0.05 deg.",
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
    if config.accel_alone:
        raise UsageError(
            f"at {config.rate_hz:g} Hz a chip measures with its accelerometer alone, and this needs the gyroscope",
            f"take --rate 1000 or less; `mpucal record` and `mpucal stream` do with --rate {config.rate_hz:g}",
        )


def source_name(options: Mapping[str, Any]) -> str:
    """The source as a person would name it; empty where none is given."""
    kind = next((name for name in SOURCES if options.get(name) is not None), None)
    if kind is None:
        return ""
    what = str(options[kind])
    if kind == "replay":
        return f"replay of {what}"
    if what.partition(":")[0] == SIMULATED:
        return "simulated vehicle" if kind == "mavlink" else "simulated chip"
    return what


def check_source(context: click.Context) -> None:
    """One source, and beside it nothing that belongs to another, or that the capture fixes.

    Raises
    ------
    UsageError : none, several, or options that do not fit the source or each other.
    """
    given = [name for name in SOURCES if context.params.get(name) is not None]
    if len(given) != 1:
        together = " and ".join(f"--{name}" for name in given)
        what = f"{together} were given together" if given else "no source was given"
        raise UsageError(what, "give exactly one of --bus BUS, --serial PORT, --mavlink URL and --replay FILE")
    if given == ["replay"]:
        # a .tlog of another ground station fixes nothing: its head is looked at where it is opened
        if context.params["replay"].suffix.lower() != TLOG:
            refuse_fixed(context)
        return
    for name in OF_A_BUS if given == ["mavlink"] else OF_A_VEHICLE:
        if _was_given(context, name):
            raise UsageError(f"{_spelled(name)} was given beside --{given[0]}, which has none", "leave it out")
    model = context.params.get("model")
    if context.params.get("tilt_only") and model not in ("auto", "tilt"):
        what = f"--model {model} was given beside --tilt-only, and tilts alone do not determine it"
        raise UsageError(what, "leave it out: tilts are fitted by the model tilt")


def check_resumed(context: click.Context) -> None:
    """Beside --resume neither a source nor what its capture fixes.

    Raises
    ------
    UsageError : it was given.
    """
    for name in (*SOURCES, *FIXED_BY_CAPTURE, "folder"):
        if _was_given(context, name):
            spelled = "-o" if name == "folder" else _spelled(name)
            raise UsageError(
                f"{spelled} was given beside --resume, and a session goes on as it began, in its folder", "leave it out"
            )


def refuse_fixed(context: click.Context) -> None:
    """Beside --replay, nothing that the capture fixes.

    Raises
    ------
    UsageError : it was given.
    """
    for name in FIXED_BY_CAPTURE:
        if _was_given(context, name):
            raise UsageError(
                f"{_spelled(name)} was given beside --replay, and the capture fixes it",
                "leave it out, or use `mpucal calibrate` to fit the capture differently",
            )


def _was_given(context: click.Context, name: str) -> bool:
    return context.get_parameter_source(name) is ParameterSource.COMMANDLINE


def _spelled(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def check_not_among(target: Path, inputs: Iterable[Path]) -> None:
    """A result never takes the place of what it was made of; UsageError where `target` is one of `inputs`."""
    if target.exists() and any(given.exists() and target.samefile(given) for given in inputs):
        raise UsageError(f"{target} is what was given to be read", "choose another name with -o")
