"""Redirection of a command's output to a log when its terminal is closed (SIGHUP)."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from ..result.clock import iso_utc


@contextmanager
def logging_after_hangup(log: Callable[[], Path], hung_up: Callable[[], None]) -> Iterator[None]:
    """Survive SIGHUP within the context; a process that ignores it already (nohup) continues to do so.

    Parameters
    ----------
    log : returns the file to which output is appended then. hung_up : called at SIGHUP.
    """
    # Windows has no SIGHUP.
    number = getattr(signal, "SIGHUP", None)
    if number is None or signal.getsignal(number) is signal.SIG_IGN:
        yield
        return

    # Of standard input, output and errors; after the terminal was closed, isatty would return False.
    on_terminal = [number for number in range(3) if os.isatty(number)]

    def handle(_number: int, _frame: FrameType | None) -> None:
        # The shell and the kernel may both send the signal.
        signal.signal(number, signal.SIG_IGN)
        _redirect(on_terminal, log())
        hung_up()

    before = signal.signal(number, handle)
    try:
        yield
    finally:
        if signal.getsignal(number) is handle:
            signal.signal(number, before)


def _redirect(descriptors: Sequence[int], log: Path) -> None:
    """Append output to `log` instead of the terminal; input has ended."""
    if not descriptors:
        return
    try:
        end = os.open(log, os.O_RDWR | os.O_CREAT | os.O_APPEND | getattr(os, "O_NOFOLLOW", 0), 0o644)
    except OSError:
        end = os.open(os.devnull, os.O_RDWR)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.write(end, f"{iso_utc()}: the terminal went away.\n".encode())
    for number in descriptors:
        os.dup2(end if number else nothing, number)
    os.close(end)
    os.close(nothing)
