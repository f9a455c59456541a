"""Page in a browser beside a session, a check or a stream: its options, and its start."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Any

import click

from ..page.address import LOOPBACK, Address, parse_address
from ..page.feed import Result
from ..report.units import accelerometer, estimated_error
from ..result.calibration import Calibration
from ..session.boards import BOARD, BOARDS, usual_board
from ..sources.opened_source import OpenedSource
from ..sources.table import source_title
from ..terminal.console import Console, console
from .common import together
from .options import Parsed
from .summary import describe_fit

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


def show_session(
    source: OpenedSource,
    options: Mapping[str, Any],
    page: Address | None,
    board: str | None,
    yes: bool,
    name: str | None = None,
    beep: bool | None = None,
    json_events: bool = False,
    page_keys: bool = False,
) -> tuple[Console, AbstractContextManager[tuple[Console, ResultCallback]]]:
    """Return the terminal for a session on `source`, and the context that shows it there and, if asked for, on a page.

    A simulation that runs faster than time is shown at the pace of its samples, unless `pace=fast` is given.

    Parameters
    ----------
    options : of the source. board, name : of the board, if given. yes : ask no questions. page_keys : see Feed.
    """
    title, board = ", ".join(filter(None, (name, source_title(options)))), choose_board(board, source)
    terminal = console(yes, json_events, beep, title, board)
    if page is None:
        return terminal, nullcontext((terminal, lambda result, paths: None))
    # The page is slow to load, and most sessions have none.
    from ..page.console import on_page  # noqa: PLC0415

    paced = not source.real_time and UNPACED not in str(options.get("bus"))
    attended = not (yes or json_events) and sys.stdin.isatty() and sys.stderr.isatty()
    about = {"title": title, "board": board}
    return terminal, on_page(terminal, page, about, page_keys, paced, json_events, attended)


def page_result(calibration: Calibration) -> Result:
    """Return the summary for the page, which lays it out itself."""
    return Result(
        calibration.verdict,
        estimated_error(calibration),
        calibration.quality.get("reasons", ()),
        [(f"{row.name}, {row.unit}", row.cells) for row in accelerometer(calibration)],
        "\n".join(describe_fit(calibration)).strip(),
    )
