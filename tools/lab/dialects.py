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
    """Return the samples of the session at a constant rate, since some dialects have no times."""
    whole = mpucal.load(SESSION)
    t_ns = np.arange(len(whole)) * 10_000_000
    return Walk.from_arrays(t_ns * 1e-9, whole.acc, whole.gyr, name="walk")


def to(name: str, put: Callable[[Path, Walk, Any], Any]) -> Write:
    """Return a function that writes a file of that name."""

    def write(folder: Path, w: Walk, ns: Any) -> Path:
        put(folder / name, w, ns)
        return folder / name

    return write


def own(path: Path, w: Walk, _ns: Any) -> None:
    """Write it as mpucal does."""
    with open_writer(path, Rows.of(w), "") as write:
        write(w)


def dialects() -> dict[str, tuple[str, Write, Hints]]:
    """Return for each dialect its writing program, the function that writes it, and the hints to read it.

    The functions are those of the tests.
    """
    tables, fixtures, logs, loggers, strangers = (
        run_path(str(ROOT / "tests" / "files" / f"{name}.py"))
        for name in ("test_tables", "conftest", "test_logs", "test_loggers", "test_strangers")
    )
    counts = Hints(rate_hz=100.0, accel_range_g=4.0, gyro_range_dps=500.0)

    def table(name: str, **how: Any) -> Write:
        return to("walk.csv", lambda path, w, ns: tables["DIALECTS"][name](w, ns).to_csv(path, index=False, **how))

    def phone(write: Callable[..., Any]) -> Write:
        return lambda folder, w, ns: write(folder, w, ns) or folder

    def bag(kind: str) -> Write:
        name = "walk.bag" if kind == "bag" else "walk"
        return lambda folder, w, ns: fixtures["write_bag_file"](folder / name, w, ns, kind)

    def ulog(path: Path, w: Walk, ns: Any) -> None:
        t_us = (ns - ns[0]) // 1000 + 5_000_000
        sensors = [(f"sensor_{name}", 0, logs["imu"](t_us, of)) for name, of in (("accel", w.acc), ("gyro", w.gyr))]
        logs["ulog"](path, *sensors)

    def raw(path: Path, w: Walk, _ns: Any) -> None:
        lines = ["\t".join(["a/g:", *map(str, row)]) for row in tables["counts"](w).tolist()]
        path.write_text("\n".join([*lines, ""]))

    def sketch(path: Path, w: Walk, _ns: Any) -> None:
        np.savetxt(path, tables["counts"](w), "%d", ",", header="ax,ay,az,gx,gy,gz", comments="")

    def labelled(path: Path, w: Walk, _ns: Any) -> None:
        line = loggers["LINES"][".txt"]
        path.write_text("\n".join(line.format(*a, *g, t) for a, g, t in zip(w.acc, w.gyr, w.t, strict=True)))

    def one_table(path: Path, w: Walk, _ns: Any) -> None:
        loggers["sensor_loggers_one_table"](w, -1, in_g=True).to_csv(path, index=False)

    return {
        "ROS 2, .mcap": ("rosbags", bag("mcap"), NO_HINTS),
        "ROS 2, .db3": ("rosbags", bag("db3"), NO_HINTS),
        "ROS 1, .bag": ("rosbags", bag("bag"), NO_HINTS),
        "what `mpucal apply` wrote": ("mpucal", to("walk.mcap", own), NO_HINTS),
        "PX4, .ulg": ("pyulog", to("walk.ulg", ulog), NO_HINTS),
        "Parquet": (
            "pandas, pyarrow",
            to("walk.parquet", lambda path, w, ns: logs["parquet_of"](w, timestamp=ns).to_parquet(path)),
            NO_HINTS,
        ),
        **{name: ("pandas", table(name), NO_HINTS) for name in tables["DIALECTS"]},
        "AndroSensor, `;` and decimal commas": ("pandas", table("AndroSensor", sep=";", decimal=","), NO_HINTS),
        "phyphox, a folder": ("pandas", phone(lambda folder, w, ns: tables["phyphox"](w, ns, folder)), NO_HINTS),
        "Sensor Logger, a folder": (
            "pandas",
            phone(lambda folder, w, ns: tables["sensor_logger"](w, ns, folder)),
            NO_HINTS,
        ),
        "Sensor Logger on iOS, one table": ("pandas", to("walk.csv", one_table), NO_HINTS),
        "two tables without names": ("pandas", phone(loggers["pair"]), NO_HINTS),
        "lines that name each number": ("Python", to("walk.txt", labelled), NO_HINTS),
        "MPU6050_raw": ("Python", to("walk.txt", raw), counts),
        "a sketch's counts": ("NumPy", to("walk.csv", sketch), counts),
        "a matrix of MATLAB without names": (
            "SciPy",
            to("walk.mat", lambda path, w, _: strangers["as_matlabs_matrix"](w, path)),
            NO_HINTS,
        ),
        **{
            Path(name).stem: (
                "Python",
                to(name, lambda path, w, _, form=form: path.write_text(form(w))),
                Hints(rate_hz=100.0) if "board" in name else NO_HINTS,
            )
            for name, form in strangers["FORMS"].items()
        },
    }


def main() -> None:
    """Write, read and calibrate each dialect, and compare with the calibration of the samples themselves."""
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
