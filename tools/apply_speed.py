"""How fast `mpucal apply` goes, and in how much memory, beside NumPy's own formula on an array in memory.

python tools/apply_speed.py                       1 GB of samples, archive to archive
python tools/apply_speed.py --gigabytes 0.1 --to .csv .mcap
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from mpucal.capture.rows import ROWS, Rows, open_writer
from mpucal.data import Samples
from mpucal.result import Calibration

# t, acc, gyr and temperature as float64, and three masks
BYTES = 8 * 8 + 3
D = np.array([[1.021, 0.013, -0.007], [-0.009, 0.987, 0.021], [0.004, -0.016, 1.034]])
B_A = np.array([0.31, -0.22, 1.08])


def write_samples(path: Path, count: int) -> None:
    """A recording of that many samples, made a run at a time."""
    rng = np.random.default_rng(1)
    acc, gyr, no = rng.normal(0.0, 5.0, (ROWS, 3)), rng.normal(0.0, 1.0, (ROWS, 3)), np.zeros(ROWS, bool)
    with open_writer(path, Rows(iter(())), "") as write:
        for first in range(0, count, ROWS):
            t = np.arange(first, first + ROWS) * 0.001
            run = Samples(t, acc + 1e-9 * first, gyr, np.full(ROWS, 25.0), no, no, no)
            n = min(ROWS, count - first)
            write(Samples(*(getattr(run, name)[:n] for name in Samples.__dataclass_fields__)))


def applied(folder: Path, source: Path, target: Path) -> tuple[float, float]:
    """Seconds and peak megabytes of `mpucal apply`, a process of its own."""
    words = [sys.executable, "-m", "mpucal", "apply", "c.json", source.name, "-o", target.name]
    code = (
        "import json, resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL);"
        "print(json.dumps(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss))"
    )
    begun = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", code, *words], cwd=folder, capture_output=True, text=True, check=True)
    return time.perf_counter() - begun, json.loads(done.stdout) / 1024


def in_memory(count: int) -> float:
    """Samples a second of the formula alone, on arrays that are there."""
    rng = np.random.default_rng(1)
    acc, gyr = rng.normal(size=(count, 3)), rng.normal(size=(count, 3))
    gain, K, b_omega = np.linalg.inv(D), np.eye(3), np.zeros(3)
    begun = time.perf_counter()
    a, w = (acc - B_A) @ gain.T, (gyr - b_omega) @ K.T
    seconds = time.perf_counter() - begun
    return len(a) / seconds if len(w) else 0.0


def copied(source: Path) -> float:
    """Megabytes a second of a plain copy on the same disk, flushed."""
    begun = time.perf_counter()
    subprocess.run(["dd", f"if={source}", f"of={source}.copy", "bs=4M", "conv=fsync", "status=none"], check=True)
    seconds = time.perf_counter() - begun
    Path(f"{source}.copy").unlink()
    return source.stat().st_size / 1e6 / seconds


def main() -> None:
    """Measure, and print a line for each kind of file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--gigabytes", type=float, default=1.0)
    parser.add_argument("--to", nargs="+", default=[".npz"], choices=[".npz", ".csv", ".mcap"])
    parser.add_argument("--folder", type=Path, default=None, help="On which disk; by default a temporary folder's.")
    options = parser.parse_args()
    count = round(options.gigabytes * 1e9 / BYTES)
    with tempfile.TemporaryDirectory(dir=options.folder) as name:
        folder = Path(name)
        Calibration(D, B_A, quality={"verdict": "good", "reasons": []}).save(folder / "c.json")
        source = folder / "in.npz"
        write_samples(source, count)
        small = folder / "small.npz"
        write_samples(small, 2 * ROWS)
        _, least = applied(folder, small, folder / "out.npz")
        print(f"{count} samples, {source.stat().st_size / 1e9:.2f} GB; a plain copy: {copied(source):.0f} MB/s")
        print(f"NumPy's formula on arrays in memory: {in_memory(min(count, 5_000_000)) / 1e6:.1f} million samples/s")
        for ending in options.to:
            target = folder / f"out{ending}"
            seconds, peak = applied(folder, source, target)
            print(
                f"mpucal apply, .npz to {ending}: {count / seconds / 1e6:.2f} million samples/s,"
                f" {source.stat().st_size / 1e6 / seconds:.0f} MB/s read, {peak:.0f} MB of memory at most"
                f" ({least:.0f} MB with {2 * ROWS} samples)"
            )
            target.unlink()


if __name__ == "__main__":
    main()
