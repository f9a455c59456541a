"""Which requests are let in, and what they may have: a pure function of the request.

A request is let in that names this server in its one Host header (so no other site's name can be made to lead here)
and has the token in its path. It can only look: the page's own files, the session's events, and the results by their
names. A key is pressed by POST, only where that was allowed and no other site sends it.
"""

from __future__ import annotations

import hmac
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from enum import Enum
from http import HTTPStatus

PAGE_FILES = {
    "": ("page.html", "text/html; charset=utf-8"),
    "page.css": ("page.css", "text/css; charset=utf-8"),
    "page.js": ("page.js", "text/javascript; charset=utf-8"),
    "board.js": ("board.js", "text/javascript; charset=utf-8"),
    "sound.js": ("sound.js", "text/javascript; charset=utf-8"),
}
KEYS = ("enough", "redo", "abort")


class What(Enum):
    """What a request asks for."""

    PAGE = "a file of the page"
    EVENTS = "the session as it goes on"
    RESULT = "a result"
    KEY = "a key"


@dataclass(frozen=True)
class Asked:
    """A request that is let in: what it asks for, and which."""

    what: What
    name: str = ""


@dataclass(frozen=True)
class Door:
    """What a request must know.

    Attributes
    ----------
    host : HOST:PORT as the page's address has it. token : the first part of its path. keys : whether keys may be sent.
    """

    host: str
    token: str
    keys: bool = False

    def asked(
        self, method: str, target: str, hosts: Sequence[str], origins: Sequence[str], results: Collection[str]
    ) -> Asked | HTTPStatus:
        """What the request asks for, or the status that refuses it.

        Parameters
        ----------
        method, target : of the request line. hosts, origins : all its headers of these names. results : by name.
        """
        if list(hosts) != [self.host]:
            return HTTPStatus.MISDIRECTED_REQUEST
        _, _, path = target.partition("/")
        token, slash, name = path.partition("/")
        if not hmac.compare_digest(token.encode(), self.token.encode()) or not slash or not target.startswith("/"):
            return HTTPStatus.NOT_FOUND
        if method == "POST":
            return self._key(name, origins)
        if method != "GET":
            return HTTPStatus.METHOD_NOT_ALLOWED
        if name in PAGE_FILES:
            return Asked(What.PAGE, name)
        if name == "events":
            return Asked(What.EVENTS)
        folder, _, result = name.partition("/")
        if folder == "results" and result in results:
            return Asked(What.RESULT, result)
        return HTTPStatus.NOT_FOUND

    def _key(self, name: str, origins: Sequence[str]) -> Asked | HTTPStatus:
        folder, _, key = name.partition("/")
        if not self.keys or folder != "keys" or key not in KEYS:
            return HTTPStatus.METHOD_NOT_ALLOWED
        if any(origin != f"http://{self.host}" for origin in origins):
            return HTTPStatus.FORBIDDEN
        return Asked(What.KEY, key)
