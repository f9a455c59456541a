"""Quick start of programs: a process that has loaded their imports forks for each of them.

    python forks.py SOCKET MODULE...

A package loads with all modules in it. SOCKET is a number. Each message on it is JSON: {"run": CODE, "argv": [...],
"folder": ..., "environment": {...}}, with the program's stdin, stdout and stderr, is answered by its process;
{"wait": PROCESS} by its exit code, as subprocess has it.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import json
import os
import pkgutil
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

MESSAGE_BYTES = 1 << 18


class Forked:
    """Started program; the caller has its pipes."""

    def __init__(self, forks: Forks, pid: int) -> None:
        self._forks, self.pid = forks, pid

    def wait(self) -> int:
        """Return its exit code; a negative signal number if a signal ended it."""
        return self._forks.ask({"wait": self.pid})


class Forks:
    """Connection of the caller to the forking process.

    Parameters
    ----------
    environment : of the forking process. modules : loaded by it.
    """

    def __init__(self, environment: dict[str, str], *modules: str) -> None:
        here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket = here
        with there:
            command = [sys.executable, __file__, str(there.fileno()), *modules]
            self._process = subprocess.Popen(
                command, env=environment, pass_fds=[there.fileno()], stdin=subprocess.DEVNULL
            )

    def start(self, code: str, *argv: object, folder: Path, environment: dict[str, str], files: list[int]) -> Forked:
        """Start `code` as the main program, with `files` as stdin, stdout and stderr."""
        words = {"run": code, "argv": [str(word) for word in argv], "folder": str(folder), "environment": environment}
        return Forked(self, self.ask(words, files))

    def ask(self, words: dict[str, Any], files: list[int] | None = None) -> int:
        """Send a message and return its answer."""
        socket.send_fds(self._socket, [json.dumps(words).encode()], files or [])
        answer = self._socket.recv(MESSAGE_BYTES)
        if not answer:
            raise RuntimeError("the process that forks has ended")
        return int(answer)

    def close(self) -> None:
        """End the forking process; programs that it started end by themselves."""
        self._socket.close()
        self._process.wait()


def load(name: str) -> None:
    """Import a module and its submodules."""
    module = importlib.import_module(name)
    for inner in pkgutil.walk_packages(getattr(module, "__path__", ()), f"{name}."):
        # some need an extra that is not installed
        with contextlib.suppress(ImportError):
            importlib.import_module(inner.name)


def serve(number: int) -> dict[str, Any] | None:
    """Answer messages until the socket ends, then return None; in a forked process return its program."""
    with socket.socket(fileno=number) as here:
        while True:
            message, files, _, _ = socket.recv_fds(here, MESSAGE_BYTES, 3)
            if not message:
                return None
            words: dict[str, Any] = json.loads(message)
            if "wait" in words:
                _, status = os.waitpid(words["wait"], 0)
                here.send(str(os.waitstatus_to_exitcode(status)).encode())
                continue
            pid = os.fork()
            if pid == 0:
                for at, file in enumerate(files):
                    os.dup2(file, at)
            for file in files:
                os.close(file)
            if pid == 0:
                return words
            here.send(str(pid).encode())


def begin(words: dict[str, Any]) -> None:
    """Run the program of a message."""
    os.chdir(words["folder"])
    os.environ.clear()
    os.environ.update(words["environment"])
    # those there are belong to other files
    sys.stdin, sys.stdout, sys.stderr = (os.fdopen(at, mode, closefd=False) for at, mode in enumerate("rww"))
    if "MPUCAL_TEST_CLOCK" in os.environ:
        ctypes.CDLL(None).share_test_clock()
        # the clock waits for this process alone
        importlib.import_module("mpucal.sources.chip").CAN_FORK = False
    sys.argv = words["argv"]
    exec(compile(words["run"], sys.argv[0], "exec"), {"__name__": "__main__"})


if __name__ == "__main__":
    for each in sys.argv[2:]:
        load(each)
    given = serve(int(sys.argv[1]))
    if given is not None:
        begin(given)
