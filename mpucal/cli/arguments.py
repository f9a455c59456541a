"""Arguments and options that mean the same in every command."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from ..result.session_files import DOCUMENT

Decorator = Callable[[Any], Any]


def together(*options: Decorator) -> Decorator:
    """Return the decorator of several options, which a command's help lists in this order."""

    def decorate(command: Any) -> Any:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


class CalibrationPath(click.Path):
    """Path of a calibration; of the folder of a session, that of its calibration.json."""

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
