"""Arguments and options of several commands, loading of the calibration that they name, and talk with the person."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from ..data import STANDARD_GRAVITY_MPS2
from ..errors import WriteBackError
from ..result.calibration import Calibration
from ..result.session_files import DOCUMENT

# Interval of the progress on a terminal.
PROGRESS_S = 2.0


def say(text: str) -> None:
    """Print a sentence on stderr."""
    click.echo(f"mpucal: {text.strip()}", err=True)


def say_done(clauses: Sequence[str], err: bool = False) -> None:
    """Print what was done, a line for each clause, on stdout or on stderr."""
    listed = ";\n  ".join(clauses)
    click.echo(f"Done: {listed}.", err=err)


def ask_in_doubt(question: str, yes: bool) -> None:
    """Ask about an objection; raise WriteBackError unless a person agrees: `yes` is no agreement."""
    objection = question.partition(". ")[0]
    if yes or not sys.stdin.isatty():
        raise WriteBackError(f"nothing was changed: {objection}", "repeat the session, or `mpucal write` it as it is")
    if not click.confirm(question[:1].upper() + question[1:], err=True):
        raise WriteBackError(f"nothing was changed: {objection}, and you declined", "repeat the session")


def ask(question: str, yes: bool) -> None:
    """Ask for confirmation; raise WriteBackError if a person declines."""
    if not yes and sys.stdin.isatty() and not click.confirm(question, err=True):
        raise WriteBackError("nothing was written: you declined", "give the command again to write it")


def confirm(question: str, with_yes: bool, yes: bool) -> bool:
    """Return the answer to a question: `with_yes` if `yes` is given, and False without a person."""
    if yes:
        return with_yes
    return sys.stdin.isatty() and click.confirm(question, err=True)


Decorator = Callable[[Any], Any]


def together(*options: Decorator) -> Decorator:
    """Return the decorator of several options, which a command's help lists in this order."""

    def decorate(command: Any) -> Any:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


class CalibrationPath(click.Path):
    """Path of a calibration; a session's folder stands for the calibration.json in it."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Return the path of the file."""
        path = Path(str(super().convert(value, param, ctx)))
        return path / DOCUMENT.name if path.is_dir() else path


PATH, CALIBRATION_PATH = click.Path(path_type=Path), CalibrationPath()
calibration_argument = click.argument("calibration", metavar="CALIBRATION", type=CALIBRATION_PATH)
noise_option = click.option("--noise", metavar="FILE", type=PATH, help="noise.json of `mpucal noise`.")
yes_option = click.option("--yes", is_flag=True, help="Ask no questions.")


def output_option(name: str, metavar: str, text: str, required: bool = False) -> Decorator:
    """Return the option -o, a path that the command takes as `name`."""
    return click.option("-o", name, metavar=metavar, type=PATH, required=required, help=text)


def json_option(text: str) -> Decorator:
    """Return the option --json, which the command takes as `as_json`."""
    return click.option("--json", "as_json", is_flag=True, help=text)


force_option = click.option("--force", is_flag=True, help="Accept a calibration whose digest is missing or wrong.")


def load_calibration(path: Path) -> Calibration:
    """Load a calibration; warn if its numbers may have changed since it was saved.

    Raises
    ------
    RecordingError : see Calibration.load.
    """
    calibration = Calibration.load(path)
    if calibration.doubt:
        say(f"{path}: {calibration.doubt}.")
    return calibration


def load_trusted(path: Path, force: bool) -> Calibration:
    """Load a calibration that is to be written somewhere.

    Raises
    ------
    WriteBackError : its digest or CRC does not match, and `force` is not given.
    RecordingError : see Calibration.load.
    """
    calibration = load_calibration(path)
    if calibration.doubt and not force:
        raise WriteBackError(f"nothing was written: {path}: {calibration.doubt}", "look at it, then give --force")
    return replace(calibration, doubt="")


def at_gravity_of(calibration: Calibration | None, options: Mapping[str, Any]) -> dict[str, Any]:
    """Return a source's options with the gravity of a calibration: a simulated chip is to feel the same one."""
    return {**options, "gravity": STANDARD_GRAVITY_MPS2 if calibration is None else calibration.gravity}
