"""Commands of mpucal in processes forked from this one: their files, their limits, and how they ended."""

from __future__ import annotations

import atexit
import gc
import os
import pkgutil
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Container, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from unittest.mock import patch

import mpucal
from mpucal.__main__ import _keep_streams
from mpucal.chip.config import Config
from mpucal.disk.growing_file import SyncThread
from mpucal.mavlink.dialect import dialect
from mpucal.report import render
from mpucal.session import results, rotate

# documented exit codes, except that of a wrong use (2)
CODES = (0, 3, 4, 5, 6)
CPU_S, WALL_S = 120, 600.0
POLL_S, KNOW_EVERY_S = 0.5, 3.0


@dataclass(frozen=True)
class Ended:
    """End of a process.

    Attributes
    ----------
    code : exit code; below 0: the signal that ended it; None: it hung. said : its output on stderr.
    """

    code: int | None
    said: str
    cpu_s: float = 0.0
    peak_mb: int = 0

    @property
    def last(self) -> str:
        """Return the last line of its output."""
        return (self.said.strip().splitlines() or [""])[-1]

    def wrong(self, codes: Container[int | None] = CODES, silent: Container[int | None] = (0, 5)) -> list[str]:
        """Return the faults of the command: a hang, a traceback, another exit code, or a failure without a sentence.

        silent : exit codes that need no sentence.
        """
        found = ["it hung"] if self.code is None else []
        if "Traceback" in self.said:
            trace = self.said[self.said.find("Traceback") :].splitlines()[-4:]
            found.append(f"a trace: {' | '.join(trace)[-300:]}")
        elif self.code is not None and self.code not in codes:
            found.append(f"exit code {self.code}: {self.last[-200:]}")
        elif self.code is not None and self.code not in silent and not self.last.startswith("mpucal: "):
            found.append(f"exit code {self.code} without a sentence: {self.last[-200:]}")
        return found


class Child:
    """Process for a function that returns an exit code; it waits until `go`, and the kernel ends it after `cpu_s`.

    It continues as a command that was started in `folder`, with stderr in the file `said` and no input.
    """

    def __init__(self, call: Callable[[], int], folder: Path, said: Path, cpu_s: int = CPU_S) -> None:
        self._said = said
        hold, self._go = os.pipe()
        self._pid = os.fork()
        if self._pid == 0:
            os.close(self._go)
            os.read(hold, 1)
            code = 1
            try:
                resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, cpu_s + 1))
                os.chdir(folder)
                for number, path in enumerate((os.devnull, os.devnull, str(said))):
                    os.dup2(os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC * (number == 2), 0o644), number)
                _keep_streams()
                code = call()
                if sys.stdout is not None:
                    sys.stdout.flush()
            except BaseException:
                traceback.print_exc()
            finally:
                os._exit(code)
        os.close(hold)

    def go(self) -> Child:
        """Start the process by a byte: a pipe that another fork holds open does not close."""
        os.write(self._go, b"!")
        os.close(self._go)
        return self

    def wait(self, wall_s: float = WALL_S) -> Ended:
        """Wait for its end, for at most `wall_s`, and return it."""
        return ended(self._pid, self._said, wall_s)


def ended(pid: int, said: Path, wall_s: float = WALL_S) -> Ended:
    """Wait for a child, for at most `wall_s`, and return how it ended, with its output in the file `said`."""
    until, done, hung = time.monotonic() + wall_s, 0, False
    while not done:
        done, status, used = os.wait4(pid, os.WNOHANG)
        if not done and time.monotonic() > until and not hung:
            hung = True
            os.kill(pid, signal.SIGKILL)
        time.sleep(0.0 if done else 0.005)
    code = os.waitstatus_to_exitcode(status)
    hung |= code == -signal.SIGXCPU
    text = said.read_text("utf-8", "replace") if said.exists() else ""
    return Ended(None if hung else code, text, used.ru_utime + used.ru_stime, used.ru_maxrss >> 10)


def lasting_folder() -> Path:
    """Return a new folder that lasts as long as this program."""
    folder = Path(tempfile.mkdtemp()).resolve()
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


@cache
def ready() -> None:
    """Load all modules of mpucal, once, before processes are forked."""
    for module in pkgutil.walk_packages(mpucal.__path__, "mpucal."):
        with suppress(ImportError):
            import_module(module.name)
    import_module("numpy.ma")  # as NumPy's median does
    dialect()
    gc.freeze()


def without_pictures() -> AbstractContextManager[object]:
    """Leave the pictures out of the reports of sessions while the block runs."""
    return patch.object(results, "render", lambda calibration, _: render(calibration))


@contextmanager
def quick(sync: bool = False) -> Iterator[None]:
    """Reduce the work of sessions while the block runs: chips are polled, and fits made, as seldom as possible.

    sync : files are synced to the disk, captures by a thread, which does not go on in a forked process.
    """
    period_s = property(lambda config: min(POLL_S, config.longest_s))
    unsynced = patch.object(SyncThread, "__init__", lambda self, _file: setattr(self, "close", lambda: None))
    with ExitStack() as stack:
        stack.enter_context(patch.object(Config, "period_s", period_s))
        stack.enter_context(patch.object(rotate, "KNOW_EVERY_S", KNOW_EVERY_S))
        if not sync:
            stack.enter_context(unsynced)
            stack.enter_context(patch.object(os, "fsync", lambda _handle: None))
        yield
