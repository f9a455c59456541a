"""The page's server: GET and server-sent events, for a few clients at a time.

It is http.server of the standard library, behind a check of its own on each request's size and time. It costs no
dependency and starts in a tenth of a second on a desk's computer; what a web framework adds (routes, forms, workers,
speed) a page with one stream and five files does not use. Server-sent events rather than a WebSocket: they need no
library on either side, the browser opens them again by itself, and they can only tell.
"""

from __future__ import annotations

import json
import socket
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from shutil import copyfileobj
from socketserver import TCPServer
from typing import Any

from .latest import Latest
from .requests import PAGE_FILES, Asked, Door, What

CLIENTS = 4
CONNECTIONS = 24
# a request's head: all of it, and until when
HEAD_BYTES, HEAD_S = 16384, 5.0
# a client that takes nothing for so long is gone
PATIENCE_S = 10.0
# so much of what a client has not taken yet waits for it
WAITING_BYTES = 32768
# so often a page is told that the session is there, though nothing happens
BEAT_S, LAST_BEAT_S = 2.0, 0.2
HEADERS = {
    "Cache-Control": "no-store",
    "Connection": "close",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
# what the page itself needs, and nothing from elsewhere
PAGE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'; require-trusted-types-for 'script'"
)
# the report has its style and pictures in it, and no script
REPORT_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'none'; sandbox"
REPORT = "report.html"


class Server(ThreadingHTTPServer):
    """Serves one session's page.

    Parameters
    ----------
    where : host and port to listen on; port 0: any that is free. name, token, keys : see Door.
    pressed : told each key. counted : told how many clients follow the session, when that changes.

    Attributes
    ----------
    latest : what the page shows. results : path of each by its name. ending : no more will come.

    Raises
    ------
    OSError : nobody can listen there.
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
        counted: Callable[[int], None] = lambda clients: None,
    ) -> None:
        self.address_family = socket.AF_INET6 if ":" in where[0] else socket.AF_INET
        super().__init__(where, Handler)
        self.door = Door(f"{name}:{self.server_port}", token, keys)
        self.latest = Latest()
        self.results: dict[str, Path] = {}
        self.ending = False
        self.pressed, self._counted = pressed, counted
        self._free = threading.Semaphore(CONNECTIONS)
        self._clients, self._counting = 0, threading.Lock()

    @property
    def clients(self) -> int:
        """How many follow the session."""
        return self._clients

    def seat(self) -> bool:
        """Take one client more, or not."""
        return self._count(1)

    def leave(self) -> None:
        """One client less."""
        self._count(-1)

    def verify_request(self, request: Any, client_address: Any) -> bool:
        """Whether there is a thread left for it."""
        return self._free.acquire(blocking=False)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """One request, in a thread of its own."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def server_bind(self) -> None:
        """Without asking a name server who this is."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = str(self.server_address[0]), self.server_address[1]

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A client that is gone is none; anything else is a bug."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)

    def _count(self, more: int) -> bool:
        with self._counting:
            if self._clients + more > CLIENTS:
                return False
            self._clients += more
            self._counted(self._clients)
            return True


class Handler(BaseHTTPRequestHandler):
    """Answers one request, and closes the connection."""

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
        """What is asked for, or why not."""
        asked = self.server.door.asked(
            self.command,
            self.path,
            self.headers.get_all("Host", []),
            self.headers.get_all("Origin", []),
            self.server.results,
        )
        if not isinstance(asked, Asked):
            self.send_error(asked)
        elif asked.what is What.PAGE:
            self._page(*PAGE_FILES[asked.name])
        elif asked.what is What.EVENTS:
            self._events()
        elif asked.what is What.RESULT:
            self._result(asked.name)
        else:
            self.server.pressed(asked.name)
            self._begin(HTTPStatus.NO_CONTENT)

    do_POST = do_HEAD = do_PUT = do_DELETE = do_OPTIONS = do_PATCH = do_GET

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """The status alone: nothing of the request comes back."""
        with suppress(OSError):
            body = f"{HTTPStatus(code).phrase}\n".encode()
            self._begin(HTTPStatus(code), {"Content-Type": "text/plain", "Content-Length": str(len(body))})
            self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """No log."""

    def version_string(self) -> str:
        """Of the server, for its header."""
        return "mpucal"

    def _head(self) -> bytes | None:
        """All of it; None where it does not come, or is too long."""
        head, until_s = b"", time.monotonic() + HEAD_S
        while b"\r\n\r\n" not in head:
            if len(head) >= HEAD_BYTES:
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
            if name == REPORT:
                kind = {"Content-Type": "text/html; charset=utf-8", "Content-Security-Policy": REPORT_POLICY}
            self._begin(HTTPStatus.OK, kind)
            copyfileobj(file, self.wfile)

    def _events(self) -> None:
        """The latest of everything, then what changes; a client that is slow gets the latest again, and no queue."""
        if not self.server.seat():
            self.send_error(HTTPStatus.SERVICE_UNAVAILABLE)
            return
        try:
            self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, WAITING_BYTES)
            if hasattr(socket, "TCP_USER_TIMEOUT"):
                self.connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, round(PATIENCE_S * 1e3))
            self._begin(HTTPStatus.OK, {"Content-Type": "text/event-stream"})
            version = 0
            while True:
                version, changed = self.server.latest.since(version, LAST_BEAT_S if self.server.ending else BEAT_S)
                self.wfile.write(f"data: {json.dumps(changed)}\n\n".encode())
        finally:
            self.server.leave()
