"""Make every fixture anew, all from seeds: python -m tools.make fixtures [FOLDER].

sessions/NAME.mcap is the capture of a whole session on the simulated chip, and NAME.json beside it is what that session
said and found: what a replay must say and find too. faults/NAME.mcap is what crossed the bus while the driver measured
a simulated chip, ten seconds at 50 Hz, that suffered the fault NAME at the fifth; NAME.json is what the driver made of
it. vectors/ are those of vectors.py.
"""

import json
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from io import StringIO
from pathlib import Path
from typing import Any

from mpucal.calibration import calibrate
from mpucal.chip.access import Bus, SessionEvent, Transaction
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.cli.running import open_runner
from mpucal.data import Recording
from mpucal.errors import EndOfCapture, SourceError
from mpucal.files.capture_writer import CaptureWriter
from mpucal.files.mcap import read_capture
from mpucal.session.events import Key, Output, Progress
from mpucal.session.plan import Plan
from mpucal.simulated.chip import open_simulated
from mpucal.simulated.faults import OF_CHIP, fault_kinds
from mpucal.sources.opening import reopen_source
from mpucal.sources.replay import Tap
from mpucal.terminal.console import JsonLines
from mpucal.terminal.keys import Keys

from . import vectors

FOLDER = Path(__file__).parents[2] / "fixtures"
# named, so that the choice of `auto` may change without them
MODEL = "hand"
FAULTY = Plan(Config(rate_hz=50))
FAULT_S, END_S = 5.0, 10.0
# outputs that are compared: prompts and decisions, without the progress between them
SAID = ("prompt", "decision")


@dataclass(frozen=True)
class Script:
    """Session to be captured: the simulated chip, its settings, and when the person presses Enter.

    Attributes
    ----------
    bus : as after --bus. config : how the chip measures. enter : beginnings of the progress that Enter answers.
    """

    bus: str
    config: Config
    enter: Sequence[str] = ()


SESSIONS = {
    "mpu6050": Script("sim:seed=1", Config(rate_hz=100, poll_s=0.05)),
    "mpu6500": Script("sim:seed=2,chip=mpu6500,rate_error_ppm=9000", Config(8, 1000, rate_hz=100, poll_s=0.1)),
    "enter": Script("sim:seed=3", Config(2, 250, rate_hz=50), ("still for 5 of", "orientation 8 of")),
}


class Typist(JsonLines):
    """Presses Enter the first time that the progress begins with one of `enter`."""

    def __init__(self, enter: Sequence[str]) -> None:
        self.said = StringIO()
        super().__init__(self.said, Keys(None, single=False))
        self._enter = list(enter)
        self._pressed: list[Key] = []

    def hear(self, output: Output) -> None:
        """Keep the output, and answer it with Enter if the script says so."""
        super().hear(output)
        if isinstance(output, Progress) and self._enter and output.text.startswith(self._enter[0]):
            self._enter.pop(0)
            self._pressed.append(Key.ENOUGH)

    def pressed(self) -> Sequence[Key]:
        """Return the keys pressed since the last call."""
        pressed, self._pressed = self._pressed, []
        return pressed


def make_session(script: Script, capture: Path) -> dict[str, Any]:
    """Run the session into `capture`; return its outputs and its result."""
    source = reopen_source({"bus": script.bus}, Plan(script.config, model=MODEL))
    person = Typist(script.enter)
    with tempfile.TemporaryDirectory() as folder:
        dated = Path(folder) / capture.name
        with open_runner(source, dated, person) as runner:
            recording = runner.measure()
            calibration = runner.calibrate(recording, partial(calibrate, model=MODEL))
        without_date(dated, capture)
    said = [json.loads(line) for line in person.said.getvalue().splitlines()]
    return {
        "bus": script.bus,
        "said": [output for output in said if output["event"] in SAID],
        "samples": len(recording),
        "verdict": calibration.verdict,
        "D": calibration.D.tolist(),
        "b_a": calibration.b_a.tolist(),
    }


def without_date(dated: Path, capture: Path) -> None:
    """Write `dated` again without the time of day, so that a fixture changes only where a session does."""
    read = read_capture(dated)
    with CaptureWriter(capture) as writer:
        writer.start({key: value for key, value in read.meta.items() if key != "recorded"})
        for record in read.records:
            if isinstance(record, SessionEvent):
                writer.event(record.name, record.t_ns, record.data)
            elif isinstance(record, Transaction):
                writer.transaction(record)


def measured(bus: Bus, config: Config = FAULTY.config, until_s: float = END_S) -> tuple[Recording, SourceError | None]:
    """Return the recording of a bus from its start until a time, or until the driver gives up, and why it gave up."""
    driver, why = Driver(bus, config), None
    try:
        driver.start()
        while driver.now_ns() < until_s * 1e9:
            driver.poll()
        driver.stop()
    except EndOfCapture:
        pass
    except SourceError as error:
        why = error
    return driver.recording(), why


def made_of_it(recording: Recording, why: SourceError | None) -> dict[str, Any]:
    """Return the expected result of a recording as JSON."""
    return {
        "samples": len(recording),
        "gaps": int(recording.gap.sum()),
        "rate_hz": recording.sensor.rate_hz,
        "gave_up": None if why is None else str(why),
    }


def make_faults(folder: Path) -> None:
    """Make the captures of faulty runs."""
    for name in fault_kinds(*OF_CHIP):
        simulated = open_simulated(f"sim:seed=8,chip=mpu6500,fault={name}@{FAULT_S:g}")
        with CaptureWriter(folder / f"{name}.mcap") as writer:
            writer.start(FAULTY.meta())
            found = made_of_it(*measured(Tap(simulated, writer.transaction)))
        (folder / f"{name}.json").write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")


def main(folder: Path = FOLDER) -> None:
    """Make all fixtures."""
    for name in ("sessions", "faults"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*/*.mcap"):  # a capture replaces no file
        old.unlink()
    for name, script in SESSIONS.items():
        found = make_session(script, folder / "sessions" / f"{name}.mcap")
        (folder / "sessions" / f"{name}.json").write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    make_faults(folder / "faults")
    vectors.write(folder / "vectors")
