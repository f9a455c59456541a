"""The speed of `mpucal apply` on a recording, and its memory, beside NumPy's own formula on an array in memory.

mpucal record --bus sim --rate 1000 --seconds 3600 -o hour.mcap
python -m tools.bench apply_speed hour.mcap --to .npz .csv .mcap
python -m tools.bench apply_speed hour.npz hour.csv            # those that apply made of it
"""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from mpucal.files import open_rows
from mpucal.result.calibration import Calibration

from .timing import command, used

D = np.array([[1.021, 0.013, -0.007], [-0.009, 0.987, 0.021], [0.004, -0.016, 1.034]])
B_A = np.array([0.31, -0.22, 1.08])
IN_MEMORY = 5_000_000
GOOD: Any = {"verdict": "good", "reasons": []}


def in_memory() -> float:
    """Return how many samples a second of processor time calibrates by the formula alone, on arrays in memory."""
    acc, gyr = np.random.default_rng(1).normal(size=(2, IN_MEMORY, 3))
    gain, K, b_omega = np.linalg.inv(D), np.eye(3), np.zeros(3)
    with used() as time:
        a, w = (acc - B_A) @ gain.T, (gyr - b_omega) @ K.T
    return len(a) / time.cpu_s if len(w) else 0.0


def main(
    files: Annotated[Sequence[Path], "recordings"],
    *,
    to: Annotated[Sequence[str], (".npz", ".csv", ".mcap")] = (".npz",),
) -> None:
    """Print a line for each conversion."""
    with tempfile.TemporaryDirectory() as name:
        Calibration(D, B_A, quality=GOOD).save(Path(name) / "c.json")
        for file in files:
            count, size = sum(map(len, open_rows(file).runs)), file.stat().st_size
            for ending in to:
                seconds, done = command(["apply", "c.json", str(file.resolve()), "-o", f"out{ending}"], Path(name))
                (Path(name) / f"out{ending}").unlink()
                print(
                    f"{file.name}, {count} samples, to {ending}: {count / seconds / 1e6:.2f} million samples/s,"
                    f" {count / done.cpu_s / 1e6:.2f} a second of the processor's,"
                    f" {size / 1e6 / done.cpu_s:.0f} MB read in it, {done.peak_mb} MB of memory at most"
                )
    # last: a started process counts the memory of this one as its own
    print(f"NumPy's formula on arrays in memory: {in_memory() / 1e6:.1f} million samples a second of the processor's")
