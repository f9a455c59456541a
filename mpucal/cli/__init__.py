"""Commands by name; each one's module is imported when it is called, so that --help loads nothing heavy."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from importlib import import_module

import click

from .. import __version__
from ..errors import did_you_mean

# Name: help text; the command is in the module of that name.
COMMANDS = {
    "session": "Guide a person through a calibration, and write the result.",
    "record": "Record a sensor to a capture file, without calibrating.",
    "calibrate": "Calibrate from a capture or another recording.",
    "batch": "Calibrate many recordings at once, and show the fleet.",
    "write": "Write a calibration to the device, or restore its previous state.",
    "check": "Check whether a calibration is still right.",
    "noise": "Measure a sensor's noise at rest.",
    "apply": "Apply a calibration to a recording.",
    "stream": "Print calibrated samples live.",
    "export": "Convert a calibration to the format of another program.",
    "diff": "Compare two calibrations, and say whether the difference is significant.",
    "merge": "Combine calibrations at different temperatures.",
    "firmware": "Write the serial bridge's firmware: a library, or onto a board.",
    "doctor": "Examine a chip and its bus.",
    "show": "Show a calibration, a config blob, a recording or a device.",
}
HELP = "help"
# Option with a value for each quantity.
UNITS = "--units"
# Key of the words of the command line in the context.
TYPED = "mpucal.typed"


def typed_words() -> list[str]:
    """Return the words of the command line as they were typed, without the program's name."""
    context = click.get_current_context()
    return list(context.find_root().meta.get(TYPED, [str(context.command.name)]))


def with_option(words: Sequence[str], option: str, value: str) -> list[str]:
    """Return the words of a command line with another value of an option."""
    words = [word for word in words if not word.startswith(f"{option}=")]
    at = words.index(option) if option in words else len(words)
    return [*words[:at], option, value, *words[at + 2 :]]


def amended(words: Sequence[str], options: str, without: str) -> list[str]:
    """Return the words of a command line with `options` changed or added, and without the option `without`.

    Parameters
    ----------
    options : options with their values, as text. without : an option, or an option and the value that it must have.
    """
    option, _, value = without.partition(" ")
    for i, word in enumerate(words):
        name, joined, given = word.partition("=")
        parted = not joined and option not in _flags(words[0]) and not "".join(words[i + 1 : i + 2]).startswith("-")
        if name == option and value in ("", given, *words[i + 1 : i + 2]):
            words = [*words[:i], *words[i + 1 + parted :]]
            break
    changes = shlex.split(options)
    for option, value in zip(changes[::2], changes[1::2], strict=True):
        words = with_option(words, option, _merged(words, value) if option == UNITS else value)
    return list(words)


def _merged(words: Sequence[str], units: str) -> str:
    """Return `units` with those of other quantities that the words have already."""
    before = words[words.index(UNITS) + 1] if UNITS in words else units
    of_quantity = dict(unit.split("=") for unit in f"{before},{units}".split(","))
    return ",".join(f"{quantity}={unit}" for quantity, unit in of_quantity.items())


def _flags(name: str) -> set[str]:
    """Return the options of a command that take no value."""
    options = getattr(commands.get_command(click.Context(commands), name), "params", ())
    return {text for option in options if getattr(option, "is_flag", False) for text in option.opts}


class Commands(click.Group):
    """Command group that imports a command when it is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return all names."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return the command of that name; None if there is none."""
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = import_module(f".{cmd_name}", __name__).command
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command that is called; fail with a suggestion if its name is misspelt."""
        ctx.meta[TYPED] = args
        if args[0] == HELP:
            args = [*args[1:2], "--help"]
            if len(args) == 1:
                click.echo(ctx.get_help())
                ctx.exit()
        if nearly := did_you_mean(args[0], COMMANDS):
            ctx.fail(f"there is no command {args[0]}{nearly}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the names with their help texts."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.command(
    cls=Commands,
    epilog="Example: `mpucal session --bus sim` runs a whole session on the simulated chip.",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.version_option(__version__, prog_name="mpucal")
def commands() -> None:
    """Calibrate the accelerometer of an MPU-6050 or MPU-6500, with the gyroscope's help."""
