"""Page of `mpucal stream`: the board's attitude, and its calibrated values."""

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
