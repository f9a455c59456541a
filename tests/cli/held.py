"""The command line of a measurement that waits at a step until it may continue, for tests of that moment.

    held.py STEP CALL WORDS...

As `mpucal WORDS`; when samples reach STEP for the CALLth time, it makes the file `held` where it runs and waits for the
file `go`.
"""

import sys
import time
from itertools import count
from pathlib import Path

from mpucal.__main__ import main
from mpucal.allan import NoiseMeter
from mpucal.session.lay_flat import LayFlat
from mpucal.session.rotate import Rotate

STEPS = {"flat": LayFlat, "rotate": Rotate, "noise": NoiseMeter}
ASK_EVERY_S = 0.01


def hold(step, call):
    add, calls = step.add, count(1)

    def held(self, samples, *seen):
        if next(calls) == call:
            Path("held").touch()
            while not Path("go").exists():
                time.sleep(ASK_EVERY_S)
        return add(self, samples, *seen)

    step.add = held


if __name__ == "__main__":
    hold(STEPS[sys.argv[1]], int(sys.argv[2]))
    main(sys.argv[3:])
