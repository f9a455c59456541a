"""Sessions on simulated sensors for the trials: in this process, with an ear for what they say, or as the command."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import asdict, dataclass, field
from functools import partial
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from mpucal.__main__ import run
from mpucal.calibration import calibrate
from mpucal.chip.driver import Driver
from mpucal.data import Recording, Vector
from mpucal.errors import Abandoned
from mpucal.result.calibration import GOOD, Calibration
from mpucal.session.events import Key, Meter, Output, Prompt, PromptKind
from mpucal.session.plan import Plan
from mpucal.session.runner import Runner
from mpucal.simulated.chip import open_simulated
from mpucal.simulated.mishaps import Mishap

from .judge import Judgement, judged

NOTHING, ABANDONED = "nothing", "abandoned"


class Ear:
    """Hears a session, presses nothing, and remembers when what was said."""

    def __init__(self) -> None:
        self.t_s = 0.0
        self.heard: list[tuple[float, Output]] = []

    def hear(self, output: Output) -> None:
        """Keep what was said, and when."""
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
        """Return when that was first asked for [s]; NaN if it never was."""
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

    def judged(self, *steps: Vector) -> Judgement:
        """Compare the calibration with the truth, before and after steps of what the accelerometer feels [m/s^2]."""
        if self.calibration is None:
            return Judgement(ABANDONED if self.code == Abandoned.exit_code else NOTHING)
        D, b_a = np.array(self.truth["D"]), np.array(self.truth["b_a"])
        # such a step is felt before D
        return judged(self.calibration, (D, b_a), *((D, b_a + D @ step) for step in steps))


@dataclass(frozen=True)
class Ended(Judgement):
    """A session that was judged; times in simulated seconds, NaN where it did not come so far."""

    name: str = ""
    seed: int = 0
    said: str = ""
    wrong: str = ""
    rotated_s: float = math.nan
    finished_s: float = math.nan
    verified_z: tuple[float, ...] = ()


def ended_of(name: str, seed: int, done: Session, wrong: str, *steps: Vector) -> Ended:
    """Judge a session: a trace is wrong in any trial, and a good one that is farther from the truth than it claims."""
    judgement = done.judged(*steps)
    if "Traceback" in done.said:
        wrong = "a trace"
    elif judgement.verdict == GOOD and judgement.false:
        wrong = "called good"
    return Ended(**asdict(judgement), name=name, seed=seed, said=done.said, wrong=wrong)


def session(words: str, plan: Plan, seed: int, ear: Any = None, mishaps: Sequence[Mishap] = ()) -> Session:
    """Run a session on `--bus words` in this process."""
    bus = open_simulated(words, plan.gravity, seed, mishaps=mishaps)
    runner = Runner(Driver(bus, plan.config), ear or Ear(), lambda *_: None, plan, (bus.hear,))
    try:
        recording = runner.measure()
    except Abandoned as error:
        return Session(code=error.exit_code, said=str(error))
    found = runner.calibrate(recording, partial(calibrate, model=plan.model, gravity=plan.gravity))
    return Session(found, bus.truth_document() or {}, recording)


def by_command(*words: str) -> tuple[Session, dict[str, Any]]:
    """Run `mpucal session words --yes`, and return the calibration.json that it left, too."""
    with TemporaryDirectory() as place, redirect_stdout(StringIO()), redirect_stderr(StringIO()) as err:
        folder = Path(place) / "session"
        code = run(["session", *words, "--yes", "-o", str(folder)])
        said = err.getvalue() if "Traceback" in err.getvalue() else (err.getvalue().splitlines() or [""])[-1]
        file = folder / "calibration.json"
        if not file.exists():
            return Session(code=code, said=said), {}
        truth = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
        return Session(Calibration.load(file), truth, code=code, said=said), json.loads(file.read_text())
