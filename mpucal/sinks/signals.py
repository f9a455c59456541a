"""SIGTERM and SIGHUP while a sink is written: as Ctrl-C, so that the old state is put back before the program ends."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

NAMES = ("SIGTERM", "SIGHUP")


@contextmanager
def interrupting() -> Iterator[None]:
    """The first of them raises KeyboardInterrupt within; what follows it does not disturb the putting back."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    ended = False

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        nonlocal ended
        if not ended:
            ended = True
            raise KeyboardInterrupt

    # Windows has no SIGHUP; and what somebody sees to already is left to them
    numbers = [number for name in NAMES if (number := getattr(signal, name, None)) and _ends(number)]
    before = {number: signal.signal(number, interrupt) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _ends(number: int) -> bool:
    """Whether the signal would end the program now."""
    return signal.getsignal(number) is signal.SIG_DFL
