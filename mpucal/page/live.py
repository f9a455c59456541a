"""The page of a stream: the board's attitude, and its calibrated values."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from ..data import Samples, Sensor, Vector
from ..session.events import Meter
from ..session.meter import MotionWatch
from .address import Address, qr_code
from .feed import Feed


class Live:
    """Shows samples on a page, four times a second.

    Parameters
    ----------
    feed : of the page; None: there is none.
    """

    def __init__(self, feed: Feed | None) -> None:
        self._feed = feed
        self._watch: MotionWatch | None = None

    def add(self, raw: Samples, calibrated: Samples, sensor: Sensor) -> None:
        """The same samples as measured and as calibrated."""
        if self._feed is None:
            return
        self._watch = self._watch or MotionWatch(sensor)
        meters = [output for output in self._watch.add(raw) if isinstance(output, Meter)]
        if meters:
            self._feed.hear(meters[-1])
            acc, gyr = calibrated.acc.mean(axis=0), calibrated.gyr.mean(axis=0)
            self._feed.show(live={"acc": acc.tolist(), "magnitude": float(np.linalg.norm(acc)), "gyr": _known(gyr)})

    def say(self, text: str) -> None:
        """A line of talk, which stays."""
        if self._feed is not None:
            self._feed.say(text)


@contextmanager
def live(where: Address | None, title: str, board: str) -> Iterator[Live]:
    """What shows samples on a page at `where`, or nowhere if that is None.

    Raises
    ------
    OutputError : the page cannot be served there.
    """
    if where is None:
        yield Live(None)
        return
    feed = Feed(where, {"title": title, "board": board})
    try:
        code = qr_code(feed.url) if sys.stderr.isatty() else ""
        print(f"{code}mpucal: page: {feed.url}", file=sys.stderr, flush=True)
        yield Live(feed)
    finally:
        feed.end()


def _known(values: Vector) -> list[float] | None:
    return values.tolist() if bool(np.isfinite(values).all()) else None
