"""Processor time of a command of mpucal in this process, by part."""

import importlib
import json
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from mpucal.__main__ import main as mpucal

IMPORTS, REST, WHOLE = "start and imports", "the rest", "whole"
# Part of a session: its functions.
PARTS = {
    "simulated chip and hand": ("mpucal.simulated.chip.bus:SimulatedBus", "read", "write", "hear"),
    "driver: accesses and decoding": ("mpucal.chip.driver:Driver", "start", "read", "poll", "stop", "recording"),
    "capture: reading": ("mpucal.files.mcap", "read_capture"),
    "capture: writing": ("mpucal.files.capture_writer:CaptureWriter", "start", "transaction", "event", "close"),
    "live fits": ("mpucal.session.live_fits:Fits", "do"),
    "state machine": ("mpucal.session.machine:Machine", "handle"),
    "words on the terminal": ("mpucal.terminal.console:Lines", "hear", "say"),
    "final fit": ("mpucal.session.runner:Runner", "calibrate"),
    "result files and report": ("mpucal.session.runner:Runner", "write"),
}


class Shares:
    """Processor time of each part so far [s]: the innermost part that is running counts."""

    def __init__(self) -> None:
        self.found: dict[str, float] = defaultdict(float)
        self._running, self._since_s = [IMPORTS], 0.0
        self._switch()
        self._running = [REST]

    def counted(self, part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return the function, whose time counts for `part`."""

        def call(*arguments: Any, **named: Any) -> Any:
            self._switch()
            self._running.append(part)
            try:
                return function(*arguments, **named)
            finally:
                self._switch()
                self._running.pop()

        return call

    def _switch(self) -> None:
        now_s = time.process_time()
        self.found[self._running[-1]] += now_s - self._since_s
        self._since_s = now_s

    def close(self) -> dict[str, float]:
        """Return the shares, and the whole."""
        self._switch()
        return {**self.found, WHOLE: self._since_s}


def run(into: str, *words: str) -> None:
    """Run a command of mpucal in this process, and write the shares into a file."""
    shares, bootstrap = Shares(), vars(importlib)["_bootstrap"]
    bootstrap._find_and_load = shares.counted(IMPORTS, bootstrap._find_and_load)
    for part, (place, *names) in PARTS.items():
        owner = shares.counted(IMPORTS, resolve_name)(place)
        for name in names:
            setattr(owner, name, shares.counted(part, getattr(owner, name)))
    try:
        mpucal(words)
    finally:
        Path(into).write_text(json.dumps(shares.close()))
