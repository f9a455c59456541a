"""The commands of syscalls.py, run in child processes with syscalls.c preloaded, and their simulated devices."""

import ctypes
import os
import re
import shutil
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from mpucal.__main__ import run
from mpucal.chip.offsets import PLACES
from mpucal.files import load
from mpucal.result.journal import Journal
from mpucal.simulated.chip.chip import Chip
from mpucal.simulated.vehicle.firmware import ParameterStore
from tools.processes import Child, Ended, lasting_folder, quick, ready

SIM, VEHICLE = "sim:seed=3,chip=mpu6500,temperature_c=", "sim:seed=7,imus=1"
QUICK = ["--target", "quick", "--yes"]
SESSION = ["session", "--bus", f"{SIM}20", "--rate", "25", *QUICK, "-o"]
FLIGHT = ["session", "--mavlink", VEHICLE, "--rate", "50", *QUICK, "--no-write", "-o"]
WORDS = {
    "session": [*SESSION, "new", "--to", "chip"],
    "session of a vehicle": [*FLIGHT, "new"],
    "record": ["record", "--bus", f"{SIM}20", "--seconds", "3", "-o", "board/walk.mcap"],
    "calibrate": ["calibrate", "in.npz", "-o", "board"],
    "merge": ["merge", "a.json", "b.json", "-o", "board"],
    "check": ["check", "a.json", "--bus", f"{SIM}20", "--yes", "-o", "board"],
    "check of a file": ["check", "a.json", "in.mcap", "-o", "board"],
    "write": ["write", "a.json", "chip", "--bus", f"{SIM}20", "-o", "board", "--yes"],
    "write to a vehicle": ["write", "v.json", "autopilot", "--mavlink", VEHICLE, "-o", "board", "--yes"],
    "restore": ["write", "chip-offsets.json", "chip", "--bus", f"{SIM}20", "-o", "board", "--yes"],
    "export": ["export", "a.json", "--to", "c-header", "-o", "board/calibration.h"],
    "apply": ["apply", "a.json", "in.npz", "-o", "board/out.csv"],
    "stream": ["stream", "--bus", f"{SIM}20", "--apply", "a.json", "--seconds", "2", "-o", "board/stream.mcap"],
    "noise": ["noise", "in.npz", "-o", "board"],
    "firmware": ["firmware", "-o", "bridge"],
}
# the vehicle's parameters that correct its accelerometers
CORRECTION = re.compile(r"INS_ACC\d?(OFFS|SCAL)_")
# exit codes of crashes are above SIGNAL; libraries on top of the stack of a crash that did not cause it
SIGNAL, OUTER = 128, re.compile(r"syscalls[.]so|libc[.]so|libpython|bin/python")
# folder of the notes of writes
STATE = ".state"


@dataclass(frozen=True)
class Failing:
    """Failure to be caused in a run.

    Attributes
    ----------
    call, error : the number of a call, and its errno. least, allocation, since : the number of an allocation of `least`
    bytes or more, and whether those after it fail, too. log : a file for all calls.
    """

    call: int = 0
    error: int = 0
    least: int = 0
    allocation: int = 0
    since: bool = False
    log: int = -1


@dataclass(frozen=True)
class Failed(Ended):
    """A command that ended; its exit code is 128 + signal where it crashed, and its stack is in what it said.

    Attributes
    ----------
    allocations : number of counted ones. changed : the content of its device differs from that before the write.
    """

    allocations: int = 0
    changed: bool = False

    @property
    def crashed(self) -> str | None:
        """Return the library that crashed, or whose call crashed."""
        libraries = re.findall(r"^(\S+)\(", self.said, re.MULTILINE) if (self.code or 0) > SIGNAL else []
        return next((Path(each).name for each in libraries if not OUTER.search(each)), None)


class Devices:
    """The simulated devices of this process.

    Attributes
    ----------
    before : their content when a sink was opened; None: none was opened.
    """

    def __init__(self) -> None:
        self._chips: list[Any] = []
        self._stores: list[Any] = []
        self.before: str | None = None

    def state(self) -> str:
        """Return their lasting content: offset registers, and parameters that correct samples."""
        words = [bytes(chip._registers[place[0] : place[2] + 2]).hex() for chip in self._chips for place in PLACES]
        return " ".join(
            [*words, *(f"{name}={store[name]}" for store in self._stores for name in store if CORRECTION.search(name))]
        )

    @contextmanager
    def watched(self, shim: Any) -> Iterator[None]:
        """Log each change of the state after a sink was opened."""

        def opening(*words: str) -> Journal:
            self.before = self.state()
            shim.syscalls_device(self.before.encode())
            return of(*words)

        def after(method: Any, mine: list[Any]) -> Any:
            def changing(device: Any, *values: Any) -> None:
                method(device, *values)
                if not any(device is each for each in mine):
                    mine.append(device)
                if self.before is not None:
                    shim.syscalls_device(self.state().encode())

            return changing

        of = Journal.of
        with ExitStack() as stack:
            stack.enter_context(patch.object(Journal, "of", opening))
            stack.enter_context(patch.object(Chip, "__init__", after(Chip.__init__, self._chips)))
            stack.enter_context(patch.object(Chip, "write", after(Chip.write, self._chips)))
            setting = after(ParameterStore.__setitem__, self._stores)
            stack.enter_context(patch.object(ParameterStore, "__setitem__", setting))
            yield


def run_failing(words: Sequence[str], folder: Path, failing: Failing = Failing()) -> Failed:
    """Run a command in `folder` with this failure."""
    hear, tell = os.pipe()
    done = Child(partial(_armed, words, folder, failing, tell), folder, folder.parent / "said").go().wait()
    os.close(tell)
    allocations, changed = map(int, os.read(hear, 100).decode().split() or (0, 0))
    os.close(hear)
    return Failed(**vars(done), allocations=allocations, changed=bool(changed))


def _armed(words: Sequence[str], folder: Path, failing: Failing, tell: int) -> int:
    shim, devices = ctypes.CDLL(None), Devices()
    shim.allocations_arm.argtypes = (ctypes.c_size_t, ctypes.c_int, ctypes.c_int)
    os.environ["XDG_STATE_HOME"] = str(folder / STATE)
    with devices.watched(shim), quick(sync=True):
        shim.syscalls_arm(str(folder).encode(), failing.call, failing.error, failing.log)
        shim.allocations_arm(failing.least, failing.allocation, failing.since)
        code = run(words)
        allocations = shim.allocations_count()
        shim.allocations_arm(0, 0, 0)
        shim.syscalls_arm(b"", 0, 0, -1)
    changed = devices.before is not None and devices.state() != devices.before
    os.write(tell, f"{allocations} {int(changed)}".encode())
    return code


def prepared() -> Path:
    """Return a folder with the inputs of the commands and an older result; load all of mpucal before the children."""
    ready()
    place = lasting_folder()
    start = place / "start"
    start.mkdir()
    warm = [word.replace(f"{SIM}20", f"{SIM}45,hand=placing") for word in SESSION]
    for name, words in (("a", SESSION), ("b", warm), ("v", FLIGHT)):
        _made([*words, str(place / name)], start)
        shutil.copy(place / name / "calibration.json", start / f"{name}.json")
    _made([*WORDS["write"][:-3], "-o", str(place / "a"), "--yes"], start)
    shutil.copy(place / "a" / "chip-offsets.json", start)
    shutil.copy(place / "a" / "capture.mcap", start / "in.mcap")
    recording = load(start / "in.mcap")
    np.savez(start / "in.npz", t=recording.t, acc=recording.acc, gyr=recording.gyr)
    shutil.copytree(place / "b", start / "board", ignore=shutil.ignore_patterns("capture*"))
    return start


def _made(words: Sequence[str], folder: Path) -> None:
    def call() -> int:
        os.environ["XDG_STATE_HOME"] = str(folder.with_name("state"))
        with quick():
            return run(words)

    done = Child(call, folder, folder.with_name("said")).go().wait()
    assert done.code == 0, done.said
