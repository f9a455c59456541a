"""Folder of a session: the given one, or a new one named by chip and time."""

from __future__ import annotations

import shlex
import shutil
from contextlib import suppress
from pathlib import Path

from ..data import Sensor
from ..disk.output_folder import OutputFolder, free_name
from ..errors import OutputError, UsageError
from ..files.folder import all_captures_in
from ..result.clock import stamp
from ..result.session_files import DOCUMENT

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
        self._stamp = stamp()
        self._given = given is not None
        self._capture_name = capture_name
        super().__init__(given or Path(f"session-{self._stamp}"), new=given is None)
        held = [self.capture, self.path / DOCUMENT.name, *([] if again else all_captures_in(self.path))]
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
