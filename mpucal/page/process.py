"""Process that serves the page; it reads lines of JSON, and answers lines of words.

The first line has the address to listen on. Each further one has `show` (changed values of the page), `results` (files
by name) or `end` (seconds for which clients may still fetch them). The process answers `port N` or `error WHY` once,
then `clients N` and `key NAME`. It ends when its stdin is closed.
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
    """Serve the page until stdin is closed; the main function of the process."""
    printing = threading.Lock()

    def answer(*words: object) -> None:
        with printing, suppress(BrokenPipeError):
            print(*words, flush=True)

    begin = json.loads(sys.stdin.readline())
    try:
        server = Server(
            (begin["host"], begin["port"]),
            begin["name"],
            begin["token"],
            begin["keys"],
            lambda key: answer("key", key),
            lambda clients: answer("clients", clients),
        )
    except OSError as error:
        answer("error", error.strerror or error)
        return
    answer("port", server.server_port)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    linger_s = 0.0
    for line in sys.stdin:
        message = json.loads(line)
        server.results.update((name, Path(path)) for name, path in message.get("results", {}).items())
        linger_s = message.get("end", linger_s)
        server.ending = linger_s > 0.0
        server.latest.update(message.get("show", {}))
    until_s = time.monotonic() + linger_s
    while server.clients and time.monotonic() < until_s:
        time.sleep(0.05)
    server.shutdown()


if __name__ == "__main__":
    serve()
