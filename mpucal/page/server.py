"""HTTP server of the page: GET and server-sent events, for a few clients at a time.

It is http.server of the standard library, with limits on each request's size and time. It needs no dependency and
starts in a tenth of a second on a desktop computer; a page with one stream and five files does not need the routes,
forms, workers and speed of a web framework. Server-sent events are used rather than a WebSocket because they need no
library on either side, the browser reopens them by itself, and they cannot carry anything to the server.
"""

from __future__ import annotations

import json
import socket
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from shutil import copyfileobj
from socketserver import TCPServer
from typing import Any

from ..result.session_files import REPORT
from .requests import PAGE_FILES, Allowed, RequestFilter

CLIENTS = 4
CONNECTIONS = 24
# Limit of the time for a request's head to arrive, and of that to fetch the results after the end.
HEAD_S = 5.0
# A client that takes nothing for this time is disconnected.
PATIENCE_S = 10.0
# Limit of a request's head, and of what waits to be sent to a client.
WAITING_BYTES = 32768
# Interval of the heartbeats, during the session and after its end.
BEAT_S, LAST_BEAT_S = 2.0, 0.2
# Interval at which the end, a key or a visitor is looked for.
ASK_EVERY_S = 0.05
HEADERS = {
    "Cache-Control": "no-store",
    "Connection": "close",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
# The page loads its own files, and nothing from elsewhere.
PAGE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'; require-trusted-types-for 'script'"
)
# The report contains its style and pictures, and no script.
REPORT_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'none'; sandbox"


class Server(ThreadingHTTPServer):
    """Server of one session's page.

    Parameters
    ----------
    where : host and port to listen on; port 0: any free one. name, token, keys : see RequestFilter.
    pressed : called with each key.

    Attributes
    ----------
    latest : values of the page. results : path of each by name.
    clients : number of those that follow the session. visited : True once there was one.

    Raises
    ------
    OSError : the address cannot be listened on.
    """

    daemon_threads = True
    request_queue_size = CONNECTIONS

    def __init__(
        self,
        where: tuple[str, int],
        name: str,
        token: str,
        keys: bool = False,
        pressed: Callable[[str], None] = lambda key: None,
    ) -> None:
        self.address_family = socket.AF_INET6 if ":" in where[0] else socket.AF_INET
        super().__init__(where, Handler)
        self.filter = RequestFilter(f"{name}:{self.server_port}", token, keys)
        self.latest = LatestValues()
        self.results: dict[str, Path] = {}
        self.pressed = pressed
        self.ending = self.ended = self.visited = False
        self._free = threading.Semaphore(CONNECTIONS)
        self.clients, self._counting = 0, threading.Lock()

    def count(self, more: int) -> bool:
        """Count clients that come (1) or leave (-1); return False if there are too many."""
        with self._counting:
            if self.clients + more > CLIENTS:
                return False
            self.clients += more
            self.visited |= more > 0
            return True

    def end(self) -> None:
        """Stop serving when no client follows any more, or after HEAD_S."""
        self.ending, until_s = True, time.monotonic() + HEAD_S
        while self.clients and time.monotonic() < until_s:
            time.sleep(ASK_EVERY_S)
        self.ended = True
        self.shutdown()
        self.server_close()

    def serve_forever(self, poll_interval: float = ASK_EVERY_S) -> None:
        """Serve until `shutdown`, which waits for one `poll_interval` at most."""
        super().serve_forever(poll_interval)

    def verify_request(self, request: Any, client_address: Any) -> bool:
        """Return True if there is a thread left for the request."""
        return self._free.acquire(blocking=False)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Process one request in its thread, and free that."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def server_bind(self) -> None:
        """Bind the socket without the reverse DNS lookup of HTTPServer."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = str(self.server_address[0]), self.server_address[1]

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore clients that are gone; report anything else, which is a bug."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class Handler(BaseHTTPRequestHandler):
    """Handler of one request, after which the connection is closed."""

    server: Server
    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True

    def handle(self) -> None:
        """Read a head within its limits; the body of a request is never read."""
        self.close_connection = True
        head = self._head()
        if head is not None:
            self.connection.settimeout(PATIENCE_S)
            self.rfile = BytesIO(head)
            self.handle_one_request()

    def do_GET(self) -> None:
        """Answer the request, or refuse it."""
        request = self.server.filter.check(
            self.command,
            self.path,
            self.headers.get_all("Host", []),
            self.headers.get_all("Origin", []),
            self.server.results,
        )
        match request:
            case Allowed("page", name):
                self._page(*PAGE_FILES[name])
            case Allowed("events"):
                self._events()
            case Allowed("results", name):
                self._result(name)
            case Allowed("keys", name):
                self.server.pressed(name)
                self._begin(HTTPStatus.NO_CONTENT)
            case HTTPStatus():
                self.send_error(request)

    do_POST = do_HEAD = do_PUT = do_DELETE = do_OPTIONS = do_PATCH = do_GET

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Send the status alone: nothing of the request is repeated."""
        with suppress(OSError):
            body = f"{HTTPStatus(code).phrase}\n".encode()
            self._begin(HTTPStatus(code), {"Content-Type": "text/plain", "Content-Length": str(len(body))})
            self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Log nothing."""

    def version_string(self) -> str:
        """Return the server's name for its header."""
        return "mpucal"

    def _head(self) -> bytes | None:
        """Return the request's head; None if it does not arrive, or is too long."""
        head, until_s = b"", time.monotonic() + HEAD_S
        while b"\r\n\r\n" not in head:
            if len(head) >= WAITING_BYTES:
                return None
            self.connection.settimeout(max(until_s - time.monotonic(), 0.001))
            piece = self.connection.recv(4096)
            if not piece:
                return None
            head += piece
        return head

    def _begin(self, status: HTTPStatus, headers: dict[str, str] | None = None) -> None:
        self.send_response(status)
        for name, value in (HEADERS | {"Content-Security-Policy": PAGE_POLICY} | (headers or {})).items():
            self.send_header(name, value)
        self.end_headers()

    def _page(self, name: str, kind: str) -> None:
        data = (files(__package__) / "static" / name).read_bytes()
        self._begin(HTTPStatus.OK, {"Content-Type": kind, "Content-Length": str(len(data))})
        self.wfile.write(data)

    def _result(self, name: str) -> None:
        try:
            file = self.server.results[name].open("rb")
        except OSError:
            self.send_error(HTTPStatus.NOT_FOUND)
            return
        with file:
            kind = {"Content-Type": "application/octet-stream", "Content-Disposition": "attachment"}
            if name == REPORT.name:
                kind = {"Content-Type": "text/html; charset=utf-8", "Content-Security-Policy": REPORT_POLICY}
            self._begin(HTTPStatus.OK, kind)
            copyfileobj(file, self.wfile)

    def _events(self) -> None:
        """Send all latest values, then their changes; a slow client skips changes, which are not queued."""
        if not self.server.count(1):
            self.send_error(HTTPStatus.SERVICE_UNAVAILABLE)
            return
        try:
            self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, WAITING_BYTES)
            if hasattr(socket, "TCP_USER_TIMEOUT"):
                self.connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, round(PATIENCE_S * 1e3))
            self._begin(HTTPStatus.OK, {"Content-Type": "text/event-stream"})
            version = 0
            while not self.server.ended:
                version, changed = self.server.latest.since(version, LAST_BEAT_S if self.server.ending else BEAT_S)
                self.wfile.write(f"data: {json.dumps(changed)}\n\n".encode())
        finally:
            self.server.count(-1)


class LatestValues:
    """Values by name, each with the version in which it changed.

    A slow client gets the latest values when it asks again, and skips those between: there is no queue.
    """

    def __init__(self) -> None:
        self._values: dict[str, tuple[int, Any]] = {}
        self._version = 0
        self._changed = threading.Condition()

    def update(self, values: Mapping[str, Any]) -> None:
        """Merge `values` and notify waiting clients."""
        with self._changed:
            self._version += 1
            self._values.update((name, (self._version, value)) for name, value in values.items())
            self._changed.notify_all()

    def since(self, version: int, wait_s: float) -> tuple[int, dict[str, Any]]:
        """Wait `wait_s` at most for changes after `version` (0: all values); return the new version and the changes."""
        with self._changed:
            self._changed.wait_for(lambda: self._version > version, wait_s)
            return self._version, {name: value for name, (of, value) in self._values.items() if of > version}
