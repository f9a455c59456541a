"""A session in the terminal and on a page, with keys from both; and the page of `mpucal stream`."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ..data import Samples, Sensor, Vector
from ..errors import MpucalError
from ..session.events import Command, Decision, Key, Meter, Output, Prompt
from ..session.meter import MotionWatch
from ..terminal.console import Console
from ..terminal.keys import Keys
from .address import Address, qr_code
from .feed import Feed, Result
from .server import ASK_EVERY_S

# Function that shows a result, and its files, on the page.
ResultCallback = Callable[[Result, Sequence[Path]], None]


class TeeConsole:
    """Console that passes everything on to another console and to a page.

    Parameters
    ----------
    paced : show each output at its own time, counted from the first: for a source that runs faster than time.
    """

    def __init__(self, console: Console, feed: Feed, paced: bool) -> None:
        self._console, self._feed, self._paced = console, feed, paced
        self.listening, self.hung_up = console.listening, console.hung_up
        self._ahead_s: float | None = None

    def hear(self, output: Output) -> None:
        """Show an output on both."""
        if self._paced and not isinstance(output, Prompt | Decision | Command):
            self._wait_until(output.t_s)
        self._console.hear(output)
        self._feed.hear(output)

    def say(self, text: str) -> None:
        """Show a message on both."""
        self._console.say(text)
        self._feed.say(text)

    def pressed(self) -> Sequence[Key]:
        """Return the keys of both that were pressed since the last call."""
        return [*self._console.pressed(), *self._feed.pressed()]

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
    """Yield a console with a page beside it, and a function that shows the result there.

    Parameters
    ----------
    where : the page's address. about, keys : see Feed. paced : see TeeConsole.
    as_json : print the address as an event. attended : somebody at the terminal opens the page and closes it.

    Raises
    ------
    OutputError : the page cannot be served there.
    """
    feed = Feed(where, about, keys)

    def show_result(result: Result, paths: Sequence[Path]) -> None:
        feed.show(**asdict(result))
        feed.offer(paths)

    try:
        _invite(feed, as_json, attended)
        yield TeeConsole(console, feed, paced), show_result
        if attended and feed.visited:
            _wait("The page stays open; press Enter to end it.", lambda: False)
    except MpucalError as error:
        feed.show(stopped=str(error))
        raise
    finally:
        feed.end()


def _invite(feed: Feed, as_json: bool, attended: bool) -> None:
    """Print the address; if somebody is at the terminal, wait until the page is open, or Enter is pressed."""
    if as_json:
        print(json.dumps({"event": "page", "address": feed.url}), file=sys.stderr, flush=True)
        return
    if not attended:
        print(f"  Page: {feed.url}", file=sys.stderr, flush=True)
        return
    print(f"{qr_code(feed.url)}\n  {feed.url}\n", file=sys.stderr)
    _wait("Open the page: the session begins when it is open, or with Enter.", lambda: feed.visited)


def _wait(what_for: str, enough: Callable[[], bool]) -> None:
    """Wait until Enter is pressed, or `enough` returns True."""
    print(f"  {what_for}", file=sys.stderr, flush=True)
    keys = Keys(sys.stdin)
    while keys.has_keyboard and not enough() and not keys.pressed():
        time.sleep(ASK_EVERY_S)


class LivePage:
    """Page that shows samples four times a second."""

    def __init__(self, feed: Feed) -> None:
        self._feed = feed
        self.say = feed.say
        self._watch: MotionWatch | None = None

    def add(self, raw: Samples, calibrated: Samples, sensor: Sensor) -> None:
        """Show samples, as measured and as calibrated."""
        self._watch = self._watch or MotionWatch(sensor)
        meters = [output for output in self._watch.add(raw) if isinstance(output, Meter)]
        if meters:
            self._feed.hear(meters[-1])
            acc, gyr = calibrated.acc.mean(axis=0), calibrated.gyr.mean(axis=0)
            self._feed.show(live={"acc": acc.tolist(), "magnitude": float(np.linalg.norm(acc)), "gyr": _known(gyr)})


@contextmanager
def live_page(where: Address, title: str, board: str) -> Iterator[LivePage]:
    """Yield a page at `where`.

    Raises
    ------
    OutputError : the page cannot be served there.
    """
    feed = Feed(where, {"title": title, "board": board})
    try:
        code = qr_code(feed.url) if sys.stderr.isatty() else ""
        print(f"{code}mpucal: page: {feed.url}", file=sys.stderr, flush=True)
        yield LivePage(feed)
    finally:
        feed.end()


def _known(values: Vector) -> list[float] | None:
    return values.tolist() if bool(np.isfinite(values).all()) else None
