"""Folder of a session and the files of its calibration: their content, and writing all of them or none."""

from __future__ import annotations

import json
import shlex
import shutil
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..data import Recording, Sensor
from ..disk.atomic import remove_file, write_atomically, write_together
from ..disk.output_folder import OutputFolder, free_name
from ..errors import MpucalError, OutputError, UsageError
from ..report import render
from ..result.calibration import Calibration
from ..result.clock import file_stamp
from ..result.session_files import BLOB, DOCUMENT, REPORT, TRUTH, captures_in, is_unfinished


def result_files(
    calibration: Calibration, recording: Recording, truth: Mapping[str, Any] | None = None
) -> Iterator[tuple[str, bytes]]:
    """Yield the name and content of each file of a result, one at a time.

    A calibration that must not be used has no blob. `truth` : the true parameters, which only a simulated sensor has.
    """
    yield DOCUMENT.name, calibration.json().encode()
    if not calibration.objection:
        yield BLOB.name, calibration.blob().encode()
    yield REPORT.name, render(calibration, recording).encode()
    if truth is not None:
        yield TRUTH.name, (json.dumps(truth, indent=2) + "\n").encode()


def calibration_files(calibration: Calibration, name: str = DOCUMENT.name) -> dict[str, bytes]:
    """Return the blob and the document `name` of a calibration, by name."""
    return {Path(name).with_suffix(".bin").name: calibration.blob().encode(), name: calibration.json().encode()}


def save(folder: Path, files: Mapping[str, bytes]) -> tuple[Path, ...]:
    """Write files by name, all or none, with calibration.json last; then the report, whose failure keeps the others.

    Raises
    ------
    OutputError : the folder or a file cannot be written.
    """
    first = sorted(files.keys() - {REPORT.name}, key=lambda name: (name == DOCUMENT.name, name))
    write_together({folder / name: files[name] for name in first})
    if REPORT.name in files:
        try:
            write_atomically(folder / REPORT.name, files[REPORT.name])
        except OutputError as error:
            # An old report would be that of another calibration.
            remove_file(folder / REPORT.name)
            raise OutputError(
                f"{error.what}; {' and '.join(first)} are kept in {folder}",
                f"make the report with `mpucal calibrate {folder} -o ELSEWHERE`",
            ) from error
    return tuple(folder / name for name in files)


def check_owner(folder: Path, calibration: Calibration, read: Path | None, *words: str) -> None:
    """Raise OutputError if `folder` holds what must stay: another recording, by its digest, or a session to be resumed.

    Parameters
    ----------
    read : path of the recording that `calibration` was made from; None for other calibrations.
    words : the command line without -o, for the remedy.
    """
    captures, document = captures_in(folder), folder / DOCUMENT.name
    own = (folder, *(captures if len(captures) == 1 else ()))
    if read is not None and any(read.samefile(each) for each in own if each.exists()):
        if is_unfinished(folder):
            raise OutputError(
                f"{folder} holds a session without results, which could not be resumed with these in it",
                f"`{shlex.join(['mpucal', *words, '-o', str(free_name(folder))])}` puts them elsewhere",
            )
        return
    owner = None
    with suppress(MpucalError, ValueError, KeyError):
        owner = Calibration.load(document).fit["recording_digest"]
    foreign = owner != calibration.fit.get("recording_digest") or (captures and read is None)
    if foreign and (captures or document.exists()):
        raise OutputError(
            f"{folder} holds {'a session' if captures else 'results'} of another recording, which is not overwritten",
            f"`{shlex.join(['mpucal', *words, '-o', str(free_name(folder))])}` puts these elsewhere",
        )


# A long session at 1 kHz takes 8 MB; its capture is written a second time when it is closed.
LEAST_FREE_BYTES = 20_000_000


class SessionFolder(OutputFolder):
    """Folder for one session, locked until it is closed; see OutputFolder.

    Parameters
    ----------
    given : its path; None: a new name in the working directory. capture_name : name of the capture to come.
    again : the folder holds earlier captures of the same session.

    Raises
    ------
    OutputError : it cannot be made, another process has it, it holds a capture or results already, or the
        disk is nearly full.
    """

    def __init__(self, given: Path | None, capture_name: str, again: bool = False) -> None:
        self._stamp = file_stamp()
        self._given = given is not None
        self._capture_name = capture_name
        super().__init__(given or Path(f"session-{self._stamp}"), new=given is None, only=again)
        held = [self.capture, self.path / DOCUMENT.name, *([] if again else captures_in(self.path))]
        if there := next((file.name for file in held if file.exists()), None):
            self.close()
            raise OutputError(
                f"{given} holds {there} already, which is not overwritten",
                "choose another folder with -o",
                f"-o {shlex.quote(str(free_name(self.path)))}",
            )
        self._check_space()

    @property
    def capture(self) -> Path:
        """Path of the capture to come."""
        return self.path / self._capture_name

    @property
    def kept(self) -> Path | None:
        """Path of the capture, if it exists."""
        with suppress(OutputError):
            return self.capture if self.capture.exists() else None
        return None

    def _check_space(self) -> None:
        """Raise OutputError if the session may fill the disk."""
        free = shutil.disk_usage(self.path).free
        if free < LEAST_FREE_BYTES:
            self.close()
            raise OutputError(
                f"only {free / 1e6:.1f} MB are free for {self.path}, and a session takes up to"
                f" {LEAST_FREE_BYTES / 1e6:.0f} MB",
                "free some space, or choose another folder with -o",
            )

    def settle(self, sensor: Sensor | None) -> None:
        """Rename a folder without a given name after its chip; delete the capture if no chip answered."""
        if sensor is None:
            self.capture.unlink(missing_ok=True)
        elif sensor.chip and not self._given:
            self.rename(f"{sensor.chip.lower()}-{self._stamp}")


def check_unfinished(folder: Path) -> None:
    """Raise UsageError if the session in `folder` has its results already, which resuming would replace."""
    if (folder / DOCUMENT.name).exists():
        raise UsageError(
            f"the session in {folder} is finished",
            f"`mpucal calibrate {folder} -o {free_name(folder)}` calibrates it again, elsewhere",
        )
