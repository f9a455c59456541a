"""Sessions on simulated sensors for the trials, in this process with their outputs, or as the command."""

import json
import math
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from functools import partial
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from mpucal.__main__ import run
from mpucal.calibration import calibrate
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.data import Recording
from mpucal.errors import Abandoned
from mpucal.result.calibration import GOOD, Calibration
from mpucal.session.events import Key, Meter, Output, Prompt, PromptKind
from mpucal.session.plan import Plan
from mpucal.session.runner import Runner
from mpucal.simulated.chip import SimulatedBus, open_simulated

from .judge import judged, judgement
from .table import Row

NOTHING, ABANDONED = "nothing", "abandoned"


class SilentOperator:
    """Operator who presses nothing, and keeps the outputs of the session with their times."""

    def __init__(self) -> None:
        self.t_s = 0.0
        self.heard: list[tuple[float, Output]] = []

    def hear(self, output: Output) -> None:
        """Keep an output with its time."""
        if isinstance(output, Meter):
            self.t_s = output.t_s
        else:
            self.heard.append((self.t_s, output))

    def pressed(self) -> Sequence[Key]:
        """Press nothing."""
        return ()

    def of(self, kind: type) -> list[Any]:
        """Return all outputs of a kind."""
        return [output for _, output in self.heard if isinstance(output, kind)]

    def when(self, kind: PromptKind) -> float:
        """Return the time [s] of the first prompt of a kind; NaN if there was none."""
        return next((t_s for t_s, one in self.heard if isinstance(one, Prompt) and one.kind is kind), math.nan)


@dataclass(frozen=True)
class Session:
    """A session that ended.

    Attributes
    ----------
    truth : of its sensor, as truth.json has it. code, said : exit code, and the last line on stderr.
    """

    calibration: Calibration | None = None
    truth: dict[str, Any] = field(default_factory=dict)
    recording: Recording | None = None
    code: int = 0
    said: str = ""

    def judged(self, **more: Any) -> Row:
        """Compare the calibration with the truth."""
        if self.calibration is None:
            return judgement(ABANDONED if self.code == Abandoned.exit_code else NOTHING, **more)
        return judged(self.calibration, (np.array(self.truth["D"]), np.array(self.truth["b_a"])), **more)


def judge_session(name: str, seed: int, done: Session, wrong: str = "", **more: Any) -> Row:
    """Judge a session; a traceback is wrong in any trial, and so is a good verdict whose error exceeds its claim."""
    row = done.judged(name=name, seed=seed, said=done.said, wrong=wrong, **more)
    if "Traceback" in done.said:
        row.wrong = "a trace"
    elif row.verdict == GOOD and row.false:
        row.wrong = "called good"
    return row


def session(words: str, plan: Plan, seed: int, ear: Any) -> Session:
    """Run a session on `--bus words` in this process."""
    bus = open_simulated(words, plan.gravity, seed)
    runner = Runner(Driver(bus, plan.config), ear, lambda *_: None, plan, (bus.hear,))
    try:
        recording = runner.measure()
    except Abandoned as error:
        return Session(code=error.exit_code, said=str(error))
    found = runner.calibrate(recording, partial(calibrate, model=plan.model, gravity=plan.gravity))
    return Session(found, bus.truth_document() or {}, recording)


def recorded(bus: SimulatedBus, config: Config, *steps: tuple[PromptKind, float]) -> Recording:
    """Return what a driver records while the hand follows prompts, each until a time [s]."""
    driver = Driver(bus, config)
    driver.start()
    for kind, until_s in steps:
        bus.hear(Prompt(kind, ""))
        while driver.now_ns() < until_s * 1e9:
            driver.poll()
    return driver.recording()


def by_command(*words: str) -> tuple[Session, dict[str, Any]]:
    """Run `mpucal session words --yes`; return the session and its calibration.json."""
    with TemporaryDirectory() as place, redirect_stdout(StringIO()), redirect_stderr(StringIO()) as err:
        folder = Path(place) / "session"
        code = run(["session", *words, "--yes", "-o", str(folder)])
        said = err.getvalue() if "Traceback" in err.getvalue() else (err.getvalue().splitlines() or [""])[-1]
        file = folder / "calibration.json"
        if not file.exists():
            return Session(code=code, said=said), {}
        truth = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
        return Session(Calibration.load(file), truth, code=code, said=said), json.loads(file.read_text())
