"""The process that serves the page, apart from the session: it is told lines of JSON, and tells lines of words.

Its first line says where to listen. Each further one has `show` (what changed on the page), `results` (files by name)
or `end` (for how many seconds clients may go on to fetch them). It answers `port N` or `error WHY` once, then
`clients N` and `key NAME`. It ends with its stdin.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

from .server import Server


def serve() -> None:
    """What the process does."""
    telling = threading.Lock()

    def tell(*words: object) -> None:
        with telling, suppress(BrokenPipeError):
            print(*words, flush=True)

    begin = json.loads(sys.stdin.readline())
    try:
        server = Server(
            (begin["host"], begin["port"]),
            begin["name"],
            begin["token"],
            begin["keys"],
            lambda key: tell("key", key),
            lambda clients: tell("clients", clients),
        )
    except OSError as error:
        tell("error", error.strerror or error)
        return
    tell("port", server.server_port)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    linger_s = 0.0
    for line in sys.stdin:
        told = json.loads(line)
        server.results.update((name, Path(path)) for name, path in told.get("results", {}).items())
        linger_s = told.get("end", linger_s)
        server.ending = linger_s > 0.0
        server.latest.update(told.get("show", {}))
    until_s = time.monotonic() + linger_s
    while server.clients and time.monotonic() < until_s:
        time.sleep(0.05)
    server.shutdown()


if __name__ == "__main__":
    serve()
