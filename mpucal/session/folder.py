"""The folder that a session fills: the one that was asked for, or a new one named by chip and time."""

from __future__ import annotations

from pathlib import Path

from ..data import Sensor
from ..errors import OutputError
from ..files.folder import captures_in
from ..result.clock import stamp
from .results import make_folder


class SessionFolder:
    """A folder without a capture, made now.

    Parameters
    ----------
    asked : where the person wants it; None: here, under a name of its own. capture_name : the file to come in it.
    again : the folder holds earlier captures of the same session.

    Attributes
    ----------
    path : where it is now.

    Raises
    ------
    OutputError : it cannot be made, or holds a capture.
    """

    def __init__(self, asked: Path | None, capture_name: str, again: bool = False) -> None:
        self._stamp = stamp()
        self._asked = asked is not None
        self._capture_name = capture_name
        self.path = asked or Path(f"session-{self._stamp}")
        if self.capture.exists() or (not again and captures_in(self.path)):
            raise OutputError(
                f"{self.path} holds a capture already, and no capture is written over",
                "choose another folder with -o",
            )
        make_folder(self.path)

    @property
    def capture(self) -> Path:
        """Where the capture goes."""
        return self.path / self._capture_name

    def settle(self, sensor: Sensor | None) -> None:
        """Give a folder that nobody named the name of its chip.

        Where none answered, take the capture away again, and the folder if nobody asked for it.
        """
        if sensor is None:
            self.capture.unlink(missing_ok=True)
            if not self._asked:
                self.path.rmdir()
        elif sensor.chip and not self._asked:
            named = Path(f"{sensor.chip.lower()}-{self._stamp}")
            if not named.exists():
                self.path = self.path.rename(named)
