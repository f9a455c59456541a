"""Feed of the page: sends the session's state to the page's process without ever waiting for it."""

from __future__ import annotations

import json
import secrets
import subprocess
import threading
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Any, cast

from ..errors import OutputError
from ..session.beside import end_beside, start_beside
from ..session.boards import BOARD
from ..session.events import Key, Output
from ..terminal.view import View
from ..terminal.voice import Voice
from .address import Address
from .state import changes, state

# Least time between two updates of the page.
LEAST_INTERVAL_S = 0.03
TOKEN_BYTES = 16
# Time that clients have after the end to fetch the results.
LINGER_S = 5.0


class Feed:
    """Process of a page, and a thread that sends it the latest view of the session.

    Outputs only change the view. If the process or its clients are slow, they skip the views between.

    Parameters
    ----------
    about : constant values: title, board. keys : True if the page may send keys.

    Attributes
    ----------
    url : address of the page, with its token. visited : True once a client has followed the session.

    Raises
    ------
    OutputError : the page cannot be served at `where`.
    """

    def __init__(self, where: Address, about: Mapping[str, Any], keys: bool = False) -> None:
        self._process = start_beside("mpucal.page.process", text=True)
        pipes = self._process.stdin, self._process.stdout
        self._stdin, self._answers = cast("tuple[IO[str], IO[str]]", pipes)
        token = secrets.token_urlsafe(TOKEN_BYTES)
        # The token is no argument of the process, because every user of the computer could read it there.
        self._send({"host": where.host, "port": where.port, "name": where.name, "token": token, "keys": keys})
        word, _, rest = self._answers.readline().strip().partition(" ")
        if word != "port":
            self.close()
            raise OutputError(
                f"no page can be served at {where.host}:{where.port} ({rest or 'its process ended'})",
                "choose another address with --page=HOST:PORT, or leave --page out",
                without="--page",
            )
        self.url = f"http://{where.name}:{rest}/{token}/"
        self.visited = False
        self._view, self._voice = View(board=str(about.get("board", BOARD))), Voice()
        self._fixed: dict[str, Any] = {**about, "keys": keys}
        self._offered: deque[dict[str, str]] = deque()
        self._pressed: deque[Key] = deque()
        self._changed, self._closed = threading.Event(), threading.Event()
        self._changed.set()
        self._threads = [
            threading.Thread(target=job, name="page", daemon=True) for job in (self._send_changes, self._listen)
        ]
        for thread in self._threads:
            thread.start()

    def hear(self, output: Output) -> None:
        """Change the view, and what is said about it."""
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
        self._offered.append({path.name: str(path.resolve()) for path in paths})
        self.show(results=[{"name": path.name, "bytes": path.stat().st_size} for path in paths])

    def pressed(self) -> Sequence[Key]:
        """Return the keys that came from the page since the last call."""
        return [self._pressed.popleft() for _ in range(len(self._pressed))]

    def end(self) -> None:
        """Send the last changes, give the clients time to fetch the results, and end the process."""
        self.show(ended=True)
        self._closed.set()
        self._changed.set()
        self._threads[0].join(LINGER_S)
        with suppress(OSError):
            self._stdin.close()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(2.0 * LINGER_S)
        self.close()

    def close(self) -> None:
        """End the process at once."""
        end_beside(self._process)

    def _send(self, message: Mapping[str, Any]) -> None:
        with suppress(OSError, ValueError):
            self._stdin.write(json.dumps(message, allow_nan=False) + "\n")
            self._stdin.flush()

    def _send_changes(self) -> None:
        old: dict[str, Any] = {}
        while True:
            self._changed.wait()
            self._changed.clear()
            last = self._closed.is_set()
            new = {**state(self._view, self._voice.said), **self._fixed}
            while self._offered:
                self._send({"results": self._offered.popleft()})
            if changed := changes(new, old):
                self._send({"show": changed})
            old = new
            if last:
                self._send({"end": LINGER_S})
                return
            self._closed.wait(LEAST_INTERVAL_S)

    def _listen(self) -> None:
        for line in self._answers:
            word, _, rest = line.strip().partition(" ")
            if word == "clients":
                self.visited = True
            elif word == "key":
                self._pressed.append(Key(rest))
