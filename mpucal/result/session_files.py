"""The files that a session leaves in its folder, one row each: name and content.

The table in docs/session.md has the same rows. A sink's files are in the sink's own row (`mpucal/sinks/table.py`).
"""

from __future__ import annotations

import re
from itertools import count, takewhile
from pathlib import Path
from typing import NamedTuple


class SessionFile(NamedTuple):
    """A file of a session's folder.

    Attributes
    ----------
    name : of the first file; further ones are numbered. what : its content, in Markdown, for docs/session.md.
    """

    name: str
    what: str

    def numbered(self, number: int) -> str:
        """Return the name of file number 1, 2, ...: capture.mcap, capture-2.mcap, ..."""
        path = Path(self.name)
        return self.name if number == 1 else f"{path.stem}-{number}{path.suffix}"

    def matches(self, name: str) -> bool:
        """Return True if `name` is the name of such a file, with any number."""
        path = Path(self.name)
        return re.fullmatch(rf"{re.escape(path.stem)}(-\d+)?{re.escape(path.suffix)}", name) is not None

    def all_in(self, folder: Path) -> list[Path]:
        """Return such files in a folder, in order; none if the first is missing."""
        return list(takewhile(Path.exists, (folder / self.numbered(number) for number in count(1))))

    def free_in(self, folder: Path) -> Path:
        """Return the first path in `folder` that does not exist yet."""
        return folder / self.numbered(len(self.all_in(folder)) + 1)


CAPTURE = SessionFile(
    "capture.mcap",
    "every register access, or packet of a vehicle, and key press with its time, written as it happens; a killed"
    " program loses a second at most",
)
# of an earlier mpucal's session with a vehicle
CAPTURE_OF_VEHICLE = SessionFile("capture.tlog", "")
DOCUMENT = SessionFile(
    "calibration.json",
    "D, b_a and the gyroscope's K, b_omega with standard deviations, the fit, the verdict and its reasons",
)
BLOB = SessionFile(
    "calibration.bin",
    "the same for firmware, specified in [firmware_protocol.md](firmware_protocol.md); not for a refused calibration",
)
REPORT = SessionFile(
    "report.html",
    "the same for a person: verdict, next steps, and values beside the data sheet; two pages in print",
)
TRUTH = SessionFile("truth.json", "true parameters of a simulated chip")

LOG = SessionFile("session.log", "messages of a session after its terminal went away")

SESSION_FILES = (CAPTURE, DOCUMENT, BLOB, REPORT, TRUTH, LOG)


def captures_in(folder: Path) -> list[Path]:
    """Return the captures of a session of a chip and of one of a vehicle."""
    return [*CAPTURE.all_in(folder), *CAPTURE_OF_VEHICLE.all_in(folder)]


def is_of_session(name: str) -> bool:
    """Return True if a file of this name is in a format of session captures."""
    return Path(name).suffix.lower() in {Path(row.name).suffix for row in (CAPTURE, CAPTURE_OF_VEHICLE)}


def is_unfinished(folder: Path) -> bool:
    """Return True if `folder` holds a session that was interrupted before its result."""
    return bool(captures_in(folder)) and not (folder / DOCUMENT.name).exists()
