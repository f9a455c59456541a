"""A made-up source, as a new one would look: a module that opens it, and a row of the table.

Run in place of mpucal, it is the command line with that row: `--turntable NAME` is a chip on a turntable.
"""

import sys

from mpucal.__main__ import run
from mpucal.errors import BusError
from mpucal.origin import Origin
from mpucal.simulated.chip import open_simulated
from mpucal.sources.chip import OpenedChip
from mpucal.sources.kind import Option, SourceKind
from mpucal.sources.table import CHIP_SETTINGS, SOURCES


def open_turntable(request):
    if request.value == "broken":
        raise BusError("the turntable is broken", "mend it")
    bus = open_simulated("sim:seed=3", request.plan.gravity)
    return OpenedChip(bus, request.plan, (bus.hear,), words=request.words, real_time=bus.real_time)


ROW = SourceKind(
    what="a chip on a turntable",
    option=Option("turntable", metavar="NAME"),
    forms="the name of a turntable",
    opener="turntable:open_turntable",
    origin=Origin.CHIP,
    options=(Option("arm_length", "How far out the chip is [m].", "M", float),),
    settings=CHIP_SETTINGS,
    title="turntable {}",
    doctor="mpucal.doctor.examine:examine_chip",
)


def add():
    SOURCES.append(ROW)


if __name__ == "__main__":
    # The row names this module, which must not be imported a second time.
    sys.modules["turntable"] = sys.modules["__main__"]
    add()
    sys.exit(run(sys.argv[1:]))
