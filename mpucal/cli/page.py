"""The options of a page beside a session or a stream."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

from ..page.address import HERE, address
from ..terminal.flat import BOARD, BOARDS
from .options import Parsed

F = TypeVar("F", bound=Callable[..., Any])


def page_options(command: F) -> F:
    """--page and --board."""
    for option in (
        click.option("--board", type=click.Choice(BOARDS), help=f"The board that is drawn; default: {BOARD}."),
        click.option(
            "--page",
            metavar="lan|HOST:PORT",
            type=Parsed(address),
            is_flag=False,
            flag_value=HERE,
            help="Show it on a page in a browser, of this computer or (lan, HOST:PORT) of its network.",
        ),
    ):
        command = option(command)
    return command
