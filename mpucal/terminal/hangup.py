"""A terminal that goes away (SIGHUP): what is said from then on goes to a log."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from ..result.clock import now

_DESCRIPTORS = (0, 1, 2)


@contextmanager
def outliving(log: Callable[[], Path], told: Callable[[], None]) -> Iterator[None]:
    """Within, SIGHUP ends nothing by itself; who ignores it already (nohup) goes on doing so.

    Parameters
    ----------
    log : where the words go that the terminal would have shown. told : is called then.
    """
    # Windows has none
    number = getattr(signal, "SIGHUP", None)
    if number is None or signal.getsignal(number) is signal.SIG_IGN:
        yield
        return

    # a terminal that is gone is not seen to have been one
    shown = [number for number in _DESCRIPTORS if os.isatty(number)]

    def gone(_number: int, _frame: FrameType | None) -> None:
        # the shell and the kernel may both say so
        signal.signal(number, signal.SIG_IGN)
        told()
        _redirect(shown, log())

    before = signal.signal(number, gone)
    try:
        yield
    finally:
        if signal.getsignal(number) is gone:
            signal.signal(number, before)


def _redirect(shown: Sequence[int], log: Path) -> None:
    """What the terminal would have shown goes to the end of `log`; nobody types any more."""
    if not shown:
        return
    try:
        end = os.open(log, os.O_RDWR | os.O_CREAT | os.O_APPEND | getattr(os, "O_NOFOLLOW", 0), 0o644)
    except OSError:
        end = os.open(os.devnull, os.O_RDWR)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.write(end, f"{now().isoformat()}: the terminal went away.\n".encode())
    for number in shown:
        os.dup2(end if number else nothing, number)
    os.close(end)
    os.close(nothing)
