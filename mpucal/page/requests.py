"""Filter of requests: a pure function from a request to the permitted resource, or to the status that refuses it.

A request is allowed if its only Host header names this server, which defeats DNS rebinding, and its path has the token.
It may read the page's own files, the session's events, and the results by their names. A key is pressed by POST, if
keys are allowed and the request does not come from another site.
"""

from __future__ import annotations

import hmac
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from http import HTTPStatus
from typing import NamedTuple

from ..session.events import Key

PAGE_FILES = {
    "": ("page.html", "text/html; charset=utf-8"),
    "page.css": ("page.css", "text/css; charset=utf-8"),
    "page.js": ("page.js", "text/javascript; charset=utf-8"),
    "board.js": ("board.js", "text/javascript; charset=utf-8"),
    "sound.js": ("sound.js", "text/javascript; charset=utf-8"),
}


class Allowed(NamedTuple):
    """Request that is allowed: the kind of its resource (page, events, results, keys), and the resource's name."""

    kind: str
    name: str = ""


@dataclass(frozen=True)
class RequestFilter:
    """Filter that knows the secret of one page.

    Attributes
    ----------
    host : HOST:PORT of the page's address. token : first part of its path. keys : True if keys may be sent.
    """

    host: str
    token: str
    keys: bool = False

    def check(
        self, method: str, target: str, hosts: Sequence[str], origins: Sequence[str], results: Collection[str]
    ) -> Allowed | HTTPStatus:
        """Return the request if it is allowed, else the status that refuses it.

        Parameters
        ----------
        method, target : of the request line. hosts, origins : all headers of these names. results : names of results.
        """
        if list(hosts) != [self.host]:
            return HTTPStatus.MISDIRECTED_REQUEST
        _, _, path = target.partition("/")
        token, slash, name = path.partition("/")
        if not hmac.compare_digest(token.encode(), self.token.encode()) or not slash or not target.startswith("/"):
            return HTTPStatus.NOT_FOUND
        kind, _, rest = name.partition("/")
        if method == "POST" and self.keys and kind == "keys" and rest in tuple(Key):
            own = all(origin == f"http://{self.host}" for origin in origins)
            return Allowed(kind, rest) if own else HTTPStatus.FORBIDDEN
        if method != "GET":
            return HTTPStatus.METHOD_NOT_ALLOWED
        if name in PAGE_FILES:
            return Allowed("page", name)
        if name == "events" or (kind == "results" and rest in results):
            return Allowed(kind, rest)
        return HTTPStatus.NOT_FOUND
