"""The exceptions of mpucal, with their exit codes on the command line.

MpucalError
├── UsageError            2  the call's words do not fit together
│   ├── WrongType            an argument is of a type that cannot be used; a TypeError too
│   └── WrongValue           an argument's value cannot be used; a ValueError too
├── SourceError           3  a device, bus or file cannot be read
│   ├── RecordingError       a file or arrays that are not a recording
│   │   └── ArraysError      arrays that are not a recording; a ValueError too
│   ├── CaptureError         a capture that is damaged, or lacks what was requested
│   ├── BusError             a transfer failed
│   │   ├── NoAnswer         no device acknowledged the address or sent a heartbeat
│   │   ├── NoStorage        the bridge's firmware has no memory for a calibration
│   │   ├── BusHeld          a wire is held low, so that every transfer times out
│   │   ├── LateRead         this computer was busy during a read, whose time is not known
│   │   └── LinkError        the link to a vehicle or board broke, or cannot be used
│   └── ChipError            the chip answers, but not as in its register map
│       ├── BoardMoved       the board moved while it had to lie still
│       ├── UnknownOffsets   the offset registers are not at a known place
│       └── ChipReset        the chip lost its settings during the measurement
├── OutputError           3  a result cannot be written to the requested place
├── Abandoned             4  the session ended before there was anything to calibrate
├── RefusedError          5  the calibration was refused, or failed its verification
└── WriteBackError        6  the write-back was refused or failed; the old state holds

EndOfCapture is not an error: a source raises it at the end of its recording.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

# characters that control a terminal or page, except line ends: controls and changes of the text's direction
CONTROLS = re.compile("[\0-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")


def escape_controls(text: str) -> str:
    """Escape control characters, so that a terminal or page only shows the text."""
    return CONTROLS.sub(lambda found: ascii(found[0])[1:-1], text)


def escape_line(text: str) -> str:
    """Escape control characters and line ends, so that quoted text cannot act on a terminal."""
    return text if text.isprintable() else "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


class MpucalError(Exception):
    """Root of the tree: what happened, on what, and what to do next.

    Parameters
    ----------
    what : one clause, no full stop: what happened, on what.
    remedy : one clause, no full stop: what the person can do next.
    options, without : command-line options that would make the same command work, and one that must be left out;
        empty if that is not enough.
    """

    exit_code = 1

    def __init__(self, what: str, remedy: str, options: str = "", without: str = "") -> None:
        super().__init__(what, remedy)
        self.options, self.without = options, without
        self.what = escape_line(what)
        self.remedy = escape_line(remedy)

    def __str__(self) -> str:
        return f"{self.what}: {self.remedy}{'' if self.remedy.endswith('?') else '.'}"


class UsageError(MpucalError):
    """The call's words do not fit together."""

    exit_code = 2


class WrongType(UsageError, TypeError):  # noqa: N818 - reads as the sentence it is
    """An argument is of a type that cannot be used."""


class WrongValue(UsageError, ValueError):  # noqa: N818 - reads as the sentence it is
    """An argument's value cannot be used."""


class SourceError(MpucalError):
    """A device, bus or file cannot be read."""

    exit_code = 3


class RecordingError(SourceError):
    """A file or arrays that are not a recording."""


class ArraysError(RecordingError, ValueError):
    """Arrays that are not a recording."""


class CaptureError(SourceError):
    """A capture that is damaged, or lacks what was requested."""


class BusError(SourceError):
    """A transfer failed."""


class NoAnswer(BusError):  # noqa: N818 - reads as the sentence it is
    """Missing reply: no device acknowledged the address or sent a heartbeat."""


class LinkError(BusError):
    """The link to a vehicle or board broke, or cannot be used."""


class NoStorage(BusError):  # noqa: N818 - reads as the sentence it is
    """The bridge's firmware has no memory for a calibration."""


class BusHeld(BusError):  # noqa: N818 - reads as the sentence it is
    """A wire of the bus is held low, so that every transfer times out."""


class LateRead(BusError):  # noqa: N818 - reads as the sentence it is
    """A busy computer delayed a read, whose time is therefore not known."""


class ChipError(SourceError):
    """The chip answers, but not as in its register map."""


class BoardMoved(ChipError):  # noqa: N818 - reads as the sentence it is
    """The board moved while it had to lie still."""


class UnknownOffsets(ChipError):  # noqa: N818 - reads as the sentence it is
    """The accelerometer's offset registers are not at a known place."""


class ChipReset(ChipError):  # noqa: N818 - reads as the sentence it is
    """The chip lost its settings during the measurement, and its samples are invalid."""


class OutputError(MpucalError):
    """A result cannot be written to the requested place."""

    exit_code = 3


class Abandoned(MpucalError):  # noqa: N818
    """The session ended before there was anything to calibrate."""

    exit_code = 4


class RefusedError(MpucalError):
    """The calibration was refused, or failed its verification."""

    exit_code = 5


class WriteBackError(MpucalError):
    """The write-back was refused or failed; the old state holds."""

    exit_code = 6


class EndOfCapture(Exception):  # noqa: N818 - not an error, and without an exit code
    """The recording behind a source has ended."""


def did_you_mean(word: str, names: Iterable[str]) -> str:
    """Return the end of a message such as "; did you mean session?" if one of `names` is close to `word`, else ""."""
    names = list(names)
    if word in names:
        return ""
    from difflib import get_close_matches  # noqa: PLC0415 - only needed after a typo

    near = get_close_matches(word, names, 1)
    return f"; did you mean {near[0]}?" if near else ""
