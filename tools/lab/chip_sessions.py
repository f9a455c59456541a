"""A session on each part of mpucal/chip/families.py, simulated by what its row says: name, temperature and verdict.

    python -m tools.lab chip_sessions [--seed 4]

One line a part, with what the row was written from; 1 where a session does not end good, under the right name, at the
right temperature, or with D nearer than 0.002 to the truth.
"""

from __future__ import annotations

import argparse
import json
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from mpucal.__main__ import run
from mpucal.chip.families import PARTS
from mpucal.simulated.chip.models import MODELS

TEMPERATURE_C, NEAR_C, NEAR = 27.0, 0.3, 2e-3
REVISION_C = ("mpu6050c", "MPU-6050C", PARTS[0x68].family.source)


def chips() -> list[tuple[str, str, str]]:
    """Of each part how --bus sim: names it, its name, and its source; revision C is one more."""
    by_family = {model.family: name for name, model in reversed(MODELS.items())}
    parts = [
        (f"{by_family[part.family]},who_am_i={who_am_i:#04x}", part.chip, part.family.source)
        for who_am_i, part in PARTS.items()
    ]
    return [*parts, REVISION_C]


def session(words: str, seed: int) -> tuple[str, float, str, float]:
    """Name, temperature [C], verdict and the largest error of D of a guided session on `sim:chip=words`."""
    with TemporaryDirectory() as folder:
        into = Path(folder) / "s"
        out = StringIO()
        asked = ["--seed", str(seed), "--rate", "50", "--model", "hand", "--yes", "--json", "--json-events"]
        with redirect_stdout(out), redirect_stderr(StringIO()):
            run(["session", "--bus", f"sim:chip={words},temperature_c={TEMPERATURE_C}", *asked, "-o", str(into)])
        found, truth = json.loads(out.getvalue()), json.loads((into / "truth.json").read_text(encoding="utf-8"))
    error = np.abs(np.array(found["accelerometer"]["D"]) - truth["D"]).max()
    return found["sensor"]["chip"], found["sensor"]["temperature_c"], found["quality"]["verdict"], float(error)


def main() -> int:
    """Run them all."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seed", type=int, default=4)
    seed, wrong = parser.parse_args().seed, 0
    for words, name, source in chips():
        chip, celsius, verdict, error = session(words, seed)
        right = chip == name and abs(celsius - TEMPERATURE_C) < NEAR_C and verdict == "good" and error < NEAR
        wrong += not right
        mark = "  " if right else "! "
        print(f"{mark}{words:24} {chip:12} {celsius:5.1f} C  {verdict}, D within {error:.1e}  ({source})", flush=True)
    return min(wrong, 1)
