"""Arguments and options that mean the same in every command."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

F = TypeVar("F", bound=Callable[..., Any])

PATH = click.Path(path_type=Path)
calibration_argument = click.argument("calibration", metavar="CALIBRATION", type=PATH)
noise_option = click.option("--noise", metavar="FILE", type=PATH, help="noise.json of `mpucal noise`.")
yes_option = click.option("--yes", is_flag=True, help="Ask no questions.")


def output_option(name: str, metavar: str, text: str, required: bool = False) -> Callable[[F], F]:
    """Return the option -o, a path that the command takes as `name`."""
    return click.option("-o", name, metavar=metavar, type=PATH, required=required, help=text)


def json_option(text: str) -> Callable[[F], F]:
    """Return the option --json, which the command takes as `as_json`."""
    return click.option("--json", "as_json", is_flag=True, help=text)
