"""Everything mpucal raises on purpose, each with the exit code of the command line.

MpucalError
├── UsageError            2  the call's words do not fit together
│   ├── WrongType            an argument is of a type that cannot be used; a TypeError too
│   └── WrongValue           an argument's value cannot be used; a ValueError too
├── SourceError           3  a device, bus or file cannot be read
│   ├── RecordingError       a file or arrays that are no recording
│   │   └── ArraysError      so are arrays; a ValueError too
│   ├── CaptureError         a capture that is damaged, or does not hold what was asked of it
│   ├── BusError             a transfer failed
│   │   ├── NoAnswer         nothing acknowledged the address, or sent a heartbeat
│   │   ├── KeepsNothing     the bridge's firmware has no memory for a calibration
│   │   ├── BusHeld          a wire is held low, so that every transfer takes its time-out
│   │   └── LinkError        the link to a vehicle or board broke, or cannot be used
│   └── ChipError            the chip answers, but not as its register map says
│       ├── OddOffsets       so do its offset registers, wherever they were looked for
│       └── ChipReset        it lost its settings while it was measured
├── OutputError           3  a result cannot be written where it was asked to go
├── Abandoned             4  the session ended before there was anything to calibrate
├── RefusedError          5  the calibration was refused, or failed its verification
└── WriteBackError        6  the write-back was refused or failed; the old state holds

EndOfCapture is no error: with it a source says that its recording has ended.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

# by a terminal or a page, beside the ends of lines: controls, and what turns the direction of the text around
OBEYED = re.compile("[\0-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")


def plain(text: str) -> str:
    """A text that a terminal or a page only shows: what it would obey is escaped."""
    return OBEYED.sub(lambda found: ascii(found[0])[1:-1], text)


def on_one_line(text: str) -> str:
    """A text that names files and quotes what they hold, as a terminal only shows it: what else it obeys is escaped."""
    return text if text.isprintable() else "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


class MpucalError(Exception):
    """Root of the tree: what happened, on what, and what to do next.

    Parameters
    ----------
    what : one clause, no full stop: what happened, on what.
    remedy : one clause, no full stop: what the person can do next.
    options : what the same command needs besides, where that is all.
    """

    exit_code = 1

    def __init__(self, what: str, remedy: str, options: str = "") -> None:
        super().__init__(what, remedy)
        self.options = options
        self.what = on_one_line(what)
        self.remedy = on_one_line(remedy)

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
    """A file or arrays that are no recording."""


class ArraysError(RecordingError, ValueError):
    """Arrays that are no recording."""


class CaptureError(SourceError):
    """A capture that is damaged, or does not hold what was asked of it."""


class BusError(SourceError):
    """A transfer failed."""


class NoAnswer(BusError):  # noqa: N818 - reads as the sentence it is
    """Nothing acknowledged the address, or sent a heartbeat."""


class LinkError(BusError):
    """The link to a vehicle or board broke, or cannot be used."""


class KeepsNothing(BusError):  # noqa: N818 - reads as the sentence it is
    """The bridge's firmware has no memory for a calibration."""


class BusHeld(BusError):  # noqa: N818 - reads as the sentence it is
    """A wire of the bus is held low, so that every transfer takes its time-out."""


class ChipError(SourceError):
    """The chip answers, but not as its register map says."""


class OddOffsets(ChipError):  # noqa: N818 - reads as the sentence it is
    """The accelerometer's offset registers answer in no known place, or as in no known one."""


class ChipReset(ChipError):  # noqa: N818 - reads as the sentence it is
    """The chip lost its settings while it was measured, and what was read says nothing."""

    def __init__(self) -> None:
        super().__init__(
            "the chip lost its settings while it was measured: it was reset",
            "its supply breaks down: check the wires and connectors, and motors on the same supply, then start again",
        )


class OutputError(MpucalError):
    """A result cannot be written where it was asked to go."""

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


class EndOfCapture(Exception):  # noqa: N818 - no error, and of no exit code: the recording behind a source has ended
    """The source holds no more."""


def meant(word: str, names: Iterable[str]) -> str:
    """What a message ends with where one of `names` is nearly `word`: "; did you mean session?", else nothing."""
    from difflib import get_close_matches  # noqa: PLC0415 - only who mistypes waits for it

    near = get_close_matches(word, names, 1)
    return f"; did you mean {near[0]}?" if near and near[0] != word else ""
