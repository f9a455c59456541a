"""The folder that a session fills: the asked one, or a new one named by chip and time."""

from __future__ import annotations

from pathlib import Path

from ..errors import OutputError
from ..files.folder import captures_in
from ..result.clock import stamp
from .results import make_folder


class Place:
    """A folder without a capture, made now.

    Parameters
    ----------
    asked : where the person wants it; None: here, under a name of its own. capture_name : the file to come in it.
    again : the folder holds earlier captures of the same session.

    Raises
    ------
    OutputError : it cannot be made, or holds a capture.
    """

    def __init__(self, asked: Path | None, capture_name: str, again: bool = False) -> None:
        self._stamp = stamp()
        self._asked = asked is not None
        self._capture_name = capture_name
        self.folder = asked or Path(f"session-{self._stamp}")
        if self.capture.exists() or (not again and captures_in(self.folder)):
            raise OutputError(
                f"{self.folder} holds a capture already, and no capture is written over",
                "choose another folder with -o",
            )
        make_folder(self.folder)

    @property
    def capture(self) -> Path:
        """Where the capture goes."""
        return self.folder / self._capture_name

    def name_by(self, chip: str) -> None:
        """Give a folder that nobody named the name of the chip."""
        target = Path(f"{chip.lower()}-{self._stamp}")
        if not self._asked and not target.exists():
            self.folder = self.folder.rename(target)

    def discard(self) -> None:
        """Take away the capture of a sensor that never answered, and the folder that nobody asked for."""
        self.capture.unlink(missing_ok=True)
        if not self._asked:
            self.folder.rmdir()
