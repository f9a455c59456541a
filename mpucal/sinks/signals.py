"""SIGTERM and SIGHUP during a write to a sink, handled as Ctrl-C, so that the old state is restored first."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

NAMES = ("SIGTERM", "SIGHUP")
REPLACED = (signal.SIG_DFL, signal.default_int_handler)


@contextmanager
def interrupting() -> Iterator[None]:
    """Raise KeyboardInterrupt in the block at the first of these signals; later ones do not disturb the restoring."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    ended = False

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        nonlocal ended
        if not ended:
            ended = True
            raise KeyboardInterrupt

    # Windows has no SIGHUP; a signal that has another handler keeps it
    numbers = [
        number for name in NAMES if (number := getattr(signal, name, None)) and signal.getsignal(number) in REPLACED
    ]
    before = {number: signal.signal(number, interrupt) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
