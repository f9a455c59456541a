"""A made-up sink, as a new one would look: a module that opens it, and a row of the table.

Run in place of mpucal, it is the command line with that row.
"""

import sys
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from mpucal.__main__ import run
from mpucal.errors import RecordingError
from mpucal.result.session_files import SessionFile
from mpucal.sinks.kind import Applied, Effect, Flag, SinkKind
from mpucal.sinks.table import SINKS
from mpucal.sources.table import BUS

OLD = SessionFile("logbook-old.txt", "what the logbook held before a write")
BOOK = Path("logbook.txt")


@contextmanager
def open_logbook(device):
    with closing(device.open().bus):
        device.say(f"this is {device.name}{', in ink' if 'ink' in device.flags else ''}")
        yield Logbook(device.name)


class Logbook:
    """A file that keeps b_a in words, after which the sensor is taken to deliver another stream."""

    def __init__(self, name):
        self.where = f"the logbook of {name}"

    def keep(self, folder):
        path = OLD.free_in(folder)
        path.write_text(BOOK.read_text() if BOOK.exists() else "b_a: nothing\n")
        return (path,)

    def write(self, calibration):
        BOOK.write_text(f"b_a: {calibration.b_a.tolist()}\n")
        return Applied(replace(calibration, b_a=np.zeros(3)), f"{self.where} says b_a")

    def put_back(self, kept):
        if not kept.read_text().startswith("b_a: "):
            raise RecordingError(f"{kept} is no page of a logbook", "give another file")
        BOOK.write_text(kept.read_text())
        return f"{self.where} says again what {kept.name} says"


ROW = SinkKind(
    "logbook",
    behind=lambda source: source.option is BUS,
    default=True,
    where="the logbook",
    holds="b_a in words",
    opener=f"{Path(__file__).stem}:open_logbook",
    effect=Effect.OTHER_STREAM,
    kept=(OLD,),
    flags=(Flag("ink", "write it in ink."),),
)


def add():
    SINKS[ROW.name] = ROW


if __name__ == "__main__":
    add()
    sys.exit(run(sys.argv[1:]))
