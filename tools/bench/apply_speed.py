"""The speed of `mpucal apply`, and its memory, beside NumPy's own formula on an array in memory.

python -m tools.bench apply_speed                                             1 GB of samples, archive to archive
python -m tools.bench apply_speed --gigabytes 0.1 --of .csv .npz --to .csv .mcap
python -m tools.bench apply_speed --gigabytes 0.1 --of .mcap          a capture: a stored session's polls, repeated
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from mpucal.chip import registers as reg
from mpucal.chip.access import Transaction
from mpucal.data import Samples
from mpucal.files import open_writer
from mpucal.files.mcap import CaptureWriter, read_capture
from mpucal.files.rows import ROWS, Rows
from mpucal.result.calibration import Calibration

from .timing import command, used

# t, acc, gyr and temperature as float64, and three masks
BYTES = 8 * 8 + 3
SESSION = Path(__file__).parents[2] / "fixtures" / "sessions" / "mpu6050.mcap"
D = np.array([[1.021, 0.013, -0.007], [-0.009, 0.987, 0.021], [0.004, -0.016, 1.034]])
B_A = np.array([0.31, -0.22, 1.08])


def write_samples(path: Path, count: int) -> None:
    """Write a recording of `count` samples, a run at a time."""
    rng = np.random.default_rng(1)
    acc, gyr, no = rng.normal(0.0, 5.0, (ROWS, 3)), rng.normal(0.0, 1.0, (ROWS, 3)), np.zeros(ROWS, bool)
    with open_writer(path, Rows(iter(())), "") as write:
        for first in range(0, count, ROWS):
            t = np.arange(first, first + ROWS) * 0.001
            run = Samples(t, acc + 1e-9 * first, gyr, np.full(ROWS, 25.0), no, no, no)
            n = min(ROWS, count - first)
            write(Samples(*(getattr(run, name)[:n] for name in Samples.__dataclass_fields__)))


def write_capture(path: Path, count: int) -> None:
    """Write a capture of at least `count` samples: those of a stored session, repeated."""
    capture = read_capture(SESSION)
    accesses = [record for record in capture.records if isinstance(record, Transaction)]
    begin = next(i for i, access in enumerate(accesses) if access.register == reg.FIFO_R_W) - 1
    # the last three put the chip to rest
    polls, length_ns = accesses[begin:-3], accesses[-4].t_ns - accesses[begin].t_ns
    frames = sum(len(access.data) for access in polls if access.register == reg.FIFO_R_W) // reg.FRAME_BYTES
    with CaptureWriter(path) as writer:
        writer.start(capture.meta)
        for access in accesses[:begin]:
            writer.transaction(access)
        for again in range(-(-count // frames)):
            for access in polls:
                writer.transaction(replace(access, t_ns=access.t_ns + again * length_ns))


def in_memory(count: int) -> float:
    """Return how many samples a second of processor time calibrates by the formula alone, on arrays in memory."""
    rng = np.random.default_rng(1)
    acc, gyr = rng.normal(size=(count, 3)), rng.normal(size=(count, 3))
    gain, K, b_omega = np.linalg.inv(D), np.eye(3), np.zeros(3)
    with used() as time:
        a, w = (acc - B_A) @ gain.T, (gyr - b_omega) @ K.T
    return len(a) / time.cpu_s if len(w) else 0.0


def copied(source: Path) -> float:
    """Return the speed [MB/s] of a plain copy on the same disk, flushed."""
    with used() as time:
        subprocess.run(["dd", f"if={source}", f"of={source}.copy", "bs=4M", "conv=fsync", "status=none"], check=True)
    Path(f"{source}.copy").unlink()
    return source.stat().st_size / 1e6 / time.wall_s


def main() -> None:
    """Measure the conversions of the options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--gigabytes", type=float, default=1.0)
    kinds = [".npz", ".csv", ".mcap"]
    parser.add_argument("--of", nargs="+", default=[".npz"], choices=kinds)
    parser.add_argument("--to", nargs="+", default=[".npz"], choices=kinds)
    parser.add_argument("--folder", type=Path, default=None, help="On which disk; by default a temporary folder's.")
    options = parser.parse_args()
    count = round(options.gigabytes * 1e9 / BYTES)
    formula = in_memory(min(count, 5_000_000)) / 1e6
    print(f"NumPy's formula on arrays in memory: {formula:.1f} million samples a second of the processor's")
    with tempfile.TemporaryDirectory(dir=options.folder) as name:
        folder = Path(name)
        Calibration(D, B_A, quality={"verdict": "good", "reasons": []}).save(folder / "c.json")
        for source in options.of:
            measure(folder, source, options.to, count)


def measure(folder: Path, kind: str, endings: list[str], count: int) -> None:
    """Print a line for each ending: `count` samples of a kind of file applied to."""
    write = write_capture if kind == ".mcap" else write_samples
    source, small = folder / f"in{kind}", folder / f"small{kind}"
    write(source, count)
    write(small, 2 * ROWS)
    _, least = command(["apply", "c.json", small.name, "-o", "out.npz"], folder)
    size = source.stat().st_size
    print(f"{kind} of {count} samples, {size / 1e9:.2f} GB; a plain copy: {copied(source):.0f} MB/s")
    for ending in endings:
        seconds, done = command(["apply", "c.json", source.name, "-o", f"out{ending}"], folder)
        print(
            f"mpucal apply, {kind} to {ending}: {count / seconds / 1e6:.2f} million samples/s,"
            f" {count / done.cpu_s / 1e6:.2f} a second of the processor's,"
            f" {size / 1e6 / done.cpu_s:.0f} MB read in it, {done.peak_mb} MB of memory at most"
            f" ({least.peak_mb} MB with {2 * ROWS} samples)"
        )
        (folder / f"out{ending}").unlink()
    source.unlink()
