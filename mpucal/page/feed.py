"""Feed of the page: the session's state for the page's server, which runs beside the session in threads.

The state is JSON: the terminal's view of the session, each event as in `--json-events`, and the result.
"""

from __future__ import annotations

import secrets
import threading
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import OutputError
from ..result.document import plain
from ..session.boards import BOARD, KINDS
from ..session.events import Key, Knowledge, Output
from ..terminal.console import count, groups
from ..terminal.view import View
from ..terminal.voice import Announcement, Voice, in_words
from .address import Address


def state(view: View, said: Announcement | None = None) -> dict[str, Any]:
    """Return the view's values and what was `said` last by name, not yet as JSON; see `changes`."""
    return {
        **vars(view),
        "moment": view.moment,
        "headline": in_words(view),
        "said": said,
        "confirming": view.confirming,
        "flat": KINDS[view.board].picture,
        "countdown": view.waiting,
        "count": None if view.progress is None else count(view.progress),
        "line": view.line,
        "known": None if view.knowledge is None else known(view.knowledge),
    }


def known(knowledge: Knowledge) -> tuple[dict[str, Any], ...]:
    """Return each kind of parameter with its target and its standard uncertainties of x, y and z."""
    return tuple(
        {
            "name": group.name,
            "target": f"{group.target:g} {group.unit}",
            "worst": group.worst,
            "axes": [
                {"times": std / group.target, "text": group.text(axis), "reached": progress >= 1.0}
                for axis, (std, progress) in enumerate(zip(group.std, group.progress, strict=True))
            ],
        }
        for group in groups(knowledge)
    )


def changes(new: Mapping[str, Any], old: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values that are new or changed, in JSON's own types."""
    return {name: plain(value) for name, value in new.items() if name not in old or value != old[name]}


# Least time between two updates of the page.
LEAST_INTERVAL_S = 0.03


class Feed:
    """Server of a page, and a thread that gives it the latest view of the session.

    Outputs only change the view. If the thread or the clients are slow, they skip the views between.

    Parameters
    ----------
    about : constant values: title, board. keys : True if the page may send keys.

    Attributes
    ----------
    url : address of the page, with its token.

    Raises
    ------
    OutputError : the page cannot be served at `where`.
    """

    def __init__(self, where: Address, about: Mapping[str, Any], keys: bool = False) -> None:
        from .server import Server  # noqa: PLC0415 - slow to import, and most sessions have no page

        token = secrets.token_urlsafe(16)
        self._pressed: deque[Key] = deque()
        try:
            self._server = Server((where.host, where.port), where.name, token, keys, self._press)
        except OSError as error:
            raise OutputError(
                f"no page can be served at {where.host}:{where.port} ({error.strerror or error})",
                "choose another address with --page=HOST:PORT, or leave --page out",
                without="--page",
            ) from error
        self.url = f"http://{self._server.filter.host}/{token}/"
        self._view, self._voice = View(board=str(about.get("board", BOARD))), Voice()
        self._fixed: dict[str, Any] = {**about, "keys": keys}
        self._changed, self._closed = threading.Event(), threading.Event()
        self._changed.set()
        self._updates = threading.Thread(target=self._update, name="page", daemon=True)
        for thread in (self._updates, threading.Thread(target=self._server.serve_forever, daemon=True)):
            thread.start()

    @property
    def visited(self) -> bool:
        """True once a client has followed the session."""
        return self._server.visited

    def hear(self, output: Output) -> None:
        """Change the view, and the announcement about it."""
        self._view = self._view.after(output)
        self._voice.hear(self._view)
        self._changed.set()

    def say(self, text: str) -> None:
        """Add a message to the view."""
        self._view = self._view.noted(text.strip())
        self._changed.set()

    def show(self, **values: Any) -> None:
        """Show further values, which are sent as they are; in JSON's own types."""
        self._fixed = {**self._fixed, **values}
        self._changed.set()

    def offer(self, paths: Sequence[Path]) -> None:
        """Offer files for download."""
        self._server.results.update((path.name, path.resolve()) for path in paths)
        self.show(results=[{"name": path.name, "bytes": path.stat().st_size} for path in paths])

    def pressed(self) -> Sequence[Key]:
        """Return the keys that came from the page since the last call."""
        return [self._pressed.popleft() for _ in range(len(self._pressed))]

    def end(self) -> None:
        """Show the last changes, give the clients time to fetch the results, and stop serving."""
        self.show(ended=True)
        self._closed.set()
        self._updates.join()
        self._server.end()

    def _press(self, key: str) -> None:
        self._pressed.append(Key(key))

    def _update(self) -> None:
        old: dict[str, Any] = {}
        while True:
            self._changed.wait()
            self._changed.clear()
            last = self._closed.is_set()
            new = {**state(self._view, self._voice.said), **self._fixed}
            self._server.latest.update(changes(new, old))
            old = new
            if last:
                return
            self._closed.wait(LEAST_INTERVAL_S)


@dataclass(frozen=True)
class Result:
    """Result of a session or a check, as the page shows it.

    Attributes
    ----------
    verdict : one word or two. estimated_error : a sentence. reasons : as calibration.json has them.
    values : name of each row of the table, and its cells for x, y and z. summary : further text.
    """

    verdict: str
    estimated_error: str = ""
    reasons: Sequence[Mapping[str, object]] = ()
    values: Sequence[tuple[str, Sequence[str]]] = ()
    summary: str = ""
