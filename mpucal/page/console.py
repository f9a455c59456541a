"""A session's console with a page beside it: what is said goes to both, and the page's keys count as the terminal's."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any, Protocol

from ..errors import MpucalError
from ..session.events import Command, Decision, Key, Output, Prompt
from ..terminal.console import Console
from ..terminal.keys import Keys
from .address import Address, qr_code
from .feed import Feed
from .result import Result

ASK_EVERY_S = 0.1


class ResultCallback(Protocol):
    """ResultCallback the page the result, and which files hold it."""

    def __call__(self, result: Result, paths: Sequence[Path]) -> None: ...  # noqa: D102


class TeeConsole:
    """A console, and a page beside it.

    Parameters
    ----------
    paced : each output is said at its own time, counted from the first: for a source whose time runs ahead.
    """

    def __init__(self, console: Console, feed: Feed, paced: bool) -> None:
        self._console, self._feed, self._paced = console, feed, paced
        self._ahead_s: float | None = None

    def hear(self, output: Output) -> None:
        """Tell both."""
        if self._paced and not isinstance(output, Prompt | Decision | Command):
            self._wait_until(output.t_s)
        self._console.hear(output)
        self._feed.hear(output)

    def say(self, text: str) -> None:
        """A line of talk, to both."""
        self._console.say(text)
        self._feed.say(text)

    def pressed(self) -> Sequence[Key]:
        """What was pressed here or there since the last call."""
        return [*self._console.pressed(), *self._feed.pressed()]

    @contextmanager
    def listening(self) -> Iterator[None]:
        """The console's."""
        with self._console.listening():
            yield

    def hung_up(self, stop: bool) -> None:
        """The terminal went away; the page stays."""
        self._console.hung_up(stop)

    def _wait_until(self, t_s: float) -> None:
        if self._ahead_s is None:
            self._ahead_s = t_s - time.monotonic()
        time.sleep(max(0.0, t_s - self._ahead_s - time.monotonic()))


@contextmanager
def on_page(
    console: Console,
    where: Address,
    about: Mapping[str, Any],
    keys: bool = False,
    paced: bool = False,
    as_json: bool = False,
    attended: bool = False,
) -> Iterator[tuple[Console, ResultCallback]]:
    """The console with a page beside it, and what tells the page the result.

    Parameters
    ----------
    where : the page's address. about, keys : see Feed. paced : see TeeConsole.
    as_json : the address is told as an event. attended : somebody at the terminal opens the page and ends it.

    Raises
    ------
    OutputError : the page cannot be served there.
    """
    feed = Feed(where, about, keys)

    def tell(result: Result, paths: Sequence[Path]) -> None:
        feed.show(**asdict(result))
        feed.offer(paths)

    try:
        _invite(feed, as_json, attended)
        yield TeeConsole(console, feed, paced), tell
        if attended and feed.visited:
            _wait("The page stays open; press Enter to end it.", lambda: False)
    except MpucalError as error:
        feed.show(stopped=str(error))
        raise
    finally:
        feed.end()


def _invite(feed: Feed, as_json: bool, attended: bool) -> None:
    """Tell the address; whoever is at the terminal has the time to open it before the session's screen is shown."""
    if as_json:
        print(json.dumps({"event": "page", "address": feed.url}), file=sys.stderr, flush=True)
        return
    if not attended:
        print(f"  Page: {feed.url}", file=sys.stderr, flush=True)
        return
    print(f"{qr_code(feed.url)}\n  {feed.url}\n", file=sys.stderr)
    _wait("Open the page: the session begins when it is open, or with Enter.", lambda: feed.visited)


def _wait(what_for: str, enough: Callable[[], bool]) -> None:
    """Until Enter is pressed, or it is enough."""
    print(f"  {what_for}", file=sys.stderr, flush=True)
    keys = Keys(sys.stdin)
    while keys.asked and not enough() and not keys.pressed():
        time.sleep(ASK_EVERY_S)
