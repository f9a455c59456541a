"""Page in a browser beside a session, a check or a stream: its options, and its start."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Any

import click

from ..page.address import LOOPBACK, Address, parse_address
from ..session.boards import BOARD, BOARDS, usual_board
from ..sources.opened_source import OpenedSource
from ..terminal.console import Console
from .arguments import together
from .options import Parsed

if TYPE_CHECKING:
    from ..page.console import ResultCallback

UNPACED = "pace=fast"
# Key of --board among the options of a source.
BOARD_KIND = "board"


page_options = together(
    click.option(
        "--page",
        metavar="lan|HOST:PORT",
        type=Parsed(parse_address),
        is_flag=False,
        flag_value=LOOPBACK,
        help="Show it on a page in a browser, on this computer or (lan, HOST:PORT) in its network.",
    ),
    click.option("--board", type=click.Choice(BOARDS), help=f"Board to draw and to speak of; default: {BOARD}."),
)


def choose_board(board: str | None, source: OpenedSource) -> str:
    """Return the board to draw: the given one, or the default of the source."""
    return board or source.plan.board or usual_board(source.origin)


def with_page(
    terminal: Console,
    page: Address | None,
    source: OpenedSource,
    options: Mapping[str, Any],
    title: str,
    board: str,
    keys: bool = False,
    as_json: bool = False,
    attended: bool = False,
) -> AbstractContextManager[tuple[Console, ResultCallback]]:
    """Return the terminal, with a page beside it if one is asked for; see `on_page`.

    A simulation that runs faster than time is shown at the pace of its samples, unless `pace=fast` is given.
    """
    if page is None:
        return nullcontext((terminal, lambda result, paths: None))
    # The page is slow to load, and most sessions have none.
    from ..page.console import on_page  # noqa: PLC0415

    paced = not source.real_time and UNPACED not in str(options.get("bus"))
    about = {"title": title, "board": board}
    return on_page(terminal, page, about, keys, paced, as_json, attended)
