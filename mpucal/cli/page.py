"""The page beside a session, a check or a stream: its options, and where it is served."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Any, TypeVar

import click

from ..page.address import HERE, Address, address
from ..sources.opened_source import OpenedSource
from ..terminal.console import Console
from ..terminal.flat import BOARD, BOARDS
from .options import Parsed

if TYPE_CHECKING:
    from ..page.console import Tells

F = TypeVar("F", bound=Callable[..., Any])
UNPACED = "pace=fast"


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


def beside(
    terminal: Console,
    page: Address | None,
    source: OpenedSource,
    options: Mapping[str, Any],
    title: str,
    board: str,
    keys: bool = False,
    as_json: bool = False,
    attended: bool = False,
) -> AbstractContextManager[tuple[Console, Tells]]:
    """The terminal, with a page beside it where one is asked for, see `on_page`.

    A source whose time runs ahead is shown at its own pace.
    """
    if page is None:
        return nullcontext((terminal, lambda result, paths: None))
    # slow to load, and most sessions are shown on none
    from ..page.console import on_page  # noqa: PLC0415

    paced = not source.real_time and UNPACED not in str(options.get("bus"))
    about = {"title": title, "board": board}
    return on_page(terminal, page, about, keys, paced, as_json, attended)
