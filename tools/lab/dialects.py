"""A session's samples in the dialects of other programs, written by their own writers, read, and calibrated.

python -m tools.lab dialects                      a row for each, as docs/recordings.md has them
python -m tools.lab dialects --only ROS
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable
from pathlib import Path
from runpy import run_path
from typing import Any

import numpy as np

import mpucal
from mpucal.files import load, open_writer
from mpucal.files.hints import NO_HINTS, Hints
from mpucal.files.rows import Rows

ROOT = Path(__file__).parents[2]
SESSION = ROOT / "fixtures" / "sessions" / "mpu6050.mcap"
EPOCH_NS = 1_403_636_579_758_555_392
Walk = mpucal.Recording
Write = Callable[[Path, Walk, Any], Path]


def walk() -> Walk:
    """The session's samples, at a steady rate: some dialects have no times."""
    whole = mpucal.load(SESSION)
    t_ns = np.arange(len(whole)) * 10_000_000
    return Walk.from_arrays(t_ns * 1e-9, whole.acc, whole.gyr, name="walk")


def dialects() -> dict[str, tuple[str, Write, Hints]]:
    """Name -> whose program writes it, how, and what has to be said to read it; the writers are those of the tests."""
    tables, ros, logs, loggers, strangers = (
        run_path(str(ROOT / "tests" / "files" / f"test_{name}.py"))
        for name in ("tables", "ros", "logs", "loggers", "strangers")
    )
    counts = Hints(rate_hz=100.0, accel_range_g=4.0, gyro_range_dps=500.0)

    def table(name: str, **how: Any) -> Write:
        def write(folder: Path, w: Walk, ns: Any) -> Path:
            tables["DIALECTS"][name](w, ns).to_csv(folder / "walk.csv", index=False, **how)
            return folder / "walk.csv"

        return write

    def phone(name: str) -> Write:
        return lambda folder, w, ns: tables[name](w, ns, folder) or folder

    def bag(kind: str) -> Write:
        return lambda folder, w, ns: ros["bag"](folder / ("walk.bag" if kind == "bag" else "walk"), w, ns, kind)

    def ulog(folder: Path, w: Walk, ns: Any) -> Path:
        t_us = (ns - ns[0]) // 1000 + 5_000_000
        sensors = [(f"sensor_{name}", 0, logs["imu"](t_us, of)) for name, of in (("accel", w.acc), ("gyro", w.gyr))]
        path: Path = logs["ulog"](folder / "walk.ulg", *sensors)
        return path

    def parquet(folder: Path, w: Walk, ns: Any) -> Path:
        logs["parquet_of"](w, timestamp=ns).to_parquet(folder / "walk.parquet")
        return folder / "walk.parquet"

    def raw(folder: Path, w: Walk, _ns: Any) -> Path:
        lines = ["\t".join(["a/g:", *map(str, row)]) for row in tables["counts"](w).tolist()]
        (folder / "walk.txt").write_text("\n".join([*lines, ""]))
        return folder / "walk.txt"

    def sketch(folder: Path, w: Walk, _ns: Any) -> Path:
        np.savetxt(folder / "walk.csv", tables["counts"](w), "%d", ",", header="ax,ay,az,gx,gy,gz", comments="")
        return folder / "walk.csv"

    def labelled(folder: Path, w: Walk, _ns: Any) -> Path:
        lines = [loggers["LINES"][".txt"].format(*a, *g, t) for a, g, t in zip(w.acc, w.gyr, w.t, strict=True)]
        (folder / "walk.txt").write_text("\n".join(lines))
        return folder / "walk.txt"

    def one_table(folder: Path, w: Walk, _ns: Any) -> Path:
        loggers["sensor_loggers_one_table"](w, -1, in_g=True).to_csv(folder / "walk.csv", index=False)
        return folder / "walk.csv"

    def unnamed(folder: Path, w: Walk, ns: Any) -> Path:
        loggers["pair"](folder, w, ns)
        return folder

    def form(name: str) -> Write:
        def write(folder: Path, w: Walk, _ns: Any) -> Path:
            (folder / name).write_text(strangers["FORMS"][name](w))
            return folder / name

        return write

    def matrix(folder: Path, w: Walk, _ns: Any) -> Path:
        strangers["as_matlabs_matrix"](w, folder / "walk.mat")
        return folder / "walk.mat"

    def own(folder: Path, w: Walk, _ns: Any) -> Path:
        with open_writer(folder / "walk.mcap", Rows.of(w), "") as write:
            write(w)
        return folder / "walk.mcap"

    return {
        "ROS 2, .mcap": ("rosbags", bag("mcap"), NO_HINTS),
        "ROS 2, .db3": ("rosbags", bag("db3"), NO_HINTS),
        "ROS 1, .bag": ("rosbags", bag("bag"), NO_HINTS),
        "what `mpucal apply` wrote": ("mpucal", own, NO_HINTS),
        "PX4, .ulg": ("pyulog", ulog, NO_HINTS),
        "Parquet": ("pandas, pyarrow", parquet, NO_HINTS),
        **{name: ("pandas", table(name), NO_HINTS) for name in tables["DIALECTS"]},
        "AndroSensor, `;` and decimal commas": ("pandas", table("AndroSensor", sep=";", decimal=","), NO_HINTS),
        "phyphox, a folder": ("pandas", phone("phyphox"), NO_HINTS),
        "Sensor Logger, a folder": ("pandas", phone("sensor_logger"), NO_HINTS),
        "Sensor Logger on iOS, one table": ("pandas", one_table, NO_HINTS),
        "two tables without names": ("pandas", unnamed, NO_HINTS),
        "lines that name each number": ("Python", labelled, NO_HINTS),
        "MPU6050_raw": ("Python", raw, counts),
        "a sketch's counts": ("NumPy", sketch, counts),
        "a matrix of MATLAB without names": ("SciPy", matrix, NO_HINTS),
        **{
            Path(name).stem: ("Python", form(name), Hints(rate_hz=100.0) if "board" in name else NO_HINTS)
            for name in strangers["FORMS"]
        },
    }


def main() -> None:
    """Write, read and calibrate each; a calibration is made once of the same samples."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="Dialects with this in their names.")
    only = parser.parse_args().only
    made = walk()
    ns = np.rint(made.t * 1e9).astype(np.int64) + EPOCH_NS
    wanted = mpucal.calibrate(made)
    print("| dialect | written by | samples' largest difference [m/s², rad/s] | D's | corrected samples' [m/s²] |")
    print("|---|---|---|---|---|")
    for name, (by, write, hints) in dialects().items():
        if only not in name:
            continue
        with tempfile.TemporaryDirectory() as folder:
            read = load(write(Path(folder), made, ns), hints)
        of_acc, of_gyr = np.abs(read.acc - made.acc).max(), np.abs(read.gyr - made.gyr).max()
        found = mpucal.calibrate(read)
        of_D = np.abs(found.D - wanted.D).max()
        corrected = np.abs(found.apply(read.acc) - wanted.apply(made.acc)).max()
        print(f"| {name} | {by} | {of_acc:.1g}, {of_gyr:.1g} | {of_D:.1g} | {corrected:.1g} |", flush=True)
