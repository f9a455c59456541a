"""Commands of mpucal in processes forked from this one: their files, their limits, and how they ended."""

from __future__ import annotations

import gc
import multiprocessing
import os
import pkgutil
import resource
import signal
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable, Container, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import mpucal
from mpucal.__main__ import _keep_streams
from mpucal.chip.config import MAX_FRAMES_A_POLL, Config
from mpucal.disk.growing_file import SyncThread
from mpucal.mavlink.dialect import dialect
from mpucal.session import rotate

# documented exit codes, except that of a wrong use (2)
CODES = (0, 3, 4, 5, 6)
CPU_S, WALL_S = 120, 600.0
POLL_S, KNOW_EVERY_S, SELDOM = 0.5, 3.0, 8.0
Tell = Callable[[Any], None]
Task = Callable[[Tell], None]


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
    """Process for a function that returns an exit code; it waits until `go`.

    Parameters
    ----------
    folder : it runs there. said : the file that becomes its stderr. cpu_s : limit of its processor time.
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
                limit_cpu(cpu_s)
                become(folder, said)
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


def limit_cpu(cpu_s: int = CPU_S) -> None:
    """Have the kernel end this process after this processor time [s]; `ended` reports that as a hang."""
    resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, cpu_s + 1))


def become(folder: Path, said: Path) -> None:
    """Continue as a command that was started in `folder`, with stderr in the file `said` and no input."""
    os.chdir(folder)
    nothing, file = os.open(os.devnull, os.O_RDWR), os.open(said, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o644)
    for number, handle in enumerate((nothing, nothing, file)):
        os.dup2(handle, number)
    os.close(nothing)
    os.close(file)
    _keep_streams()


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


class Report:
    """Outcomes by kind: their numbers, and what was wrong."""

    def __init__(self) -> None:
        self._told: dict[str, list[str]] = {}

    def tell(self, kind: str, wrong: str = "") -> None:
        """Count an outcome of this kind, and what was wrong, if anything was."""
        self._told.setdefault(kind, []).append(wrong)

    def shown(self) -> int:
        """Print a line for each kind; return 1 if something was wrong."""
        for kind, told in self._told.items():
            wrong = Counter(filter(None, told))
            print(f"{kind:32} {len(told):7} {f'{wrong.total()} wrong' if wrong else 'as they ought to be'}")
            for what, count in wrong.most_common(8):
                print(f"    WRONG {count} x {what}", flush=True)
        return int(any(map(any, self._told.values())))


class Died(NamedTuple):
    """Premature end of a task: its exit code, or below 0 the signal."""

    code: int


def forked(tasks: list[Task], jobs: int) -> Iterator[tuple[Task, Any]]:
    """Run tasks in processes of their own, which may crash, hang or be killed.

    Yields a task with each of its messages, and a Died after a premature end. Tasks may be added to the list meanwhile.
    """
    fork, running = multiprocessing.get_context("fork"), {}
    while tasks or running:
        while tasks and len(running) < jobs:
            hear, tell = fork.Pipe(duplex=False)
            process = fork.Process(target=tasks[0], args=(tell.send,))
            running[hear] = process, tasks.pop(0)
            process.start()
            tell.close()
        for hear in wait(running):
            process, task = running[hear]
            try:
                yield task, hear.recv()
            except EOFError:
                process.join()
                del running[hear]
                hear.close()
                if process.exitcode:
                    yield task, Died(process.exitcode)


def ready() -> None:
    """Load all modules of mpucal before processes are forked."""
    for module in pkgutil.walk_packages(mpucal.__path__, "mpucal."):
        with suppress(ImportError):
            import_module(module.name)
    dialect()
    gc.freeze()


@contextmanager
def quick(sync: bool = False) -> Iterator[None]:
    """Reduce the work of sessions while the block runs: chips are polled, and fits made, as seldom as possible.

    sync : captures are synced to the disk, by a thread, which does not go on in a forked process.
    """
    period_s = property(lambda config: min(POLL_S, MAX_FRAMES_A_POLL / config.rate_hz))
    unsynced = patch.object(SyncThread, "__init__", lambda self, _file: setattr(self, "close", lambda: None))
    with ExitStack() as stack:
        stack.enter_context(patch.object(Config, "period_s", period_s))
        stack.enter_context(patch.multiple(rotate, KNOW_EVERY_S=KNOW_EVERY_S, SELDOM=SELDOM))
        if not sync:
            stack.enter_context(unsynced)
        yield
