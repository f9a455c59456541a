"""A session's samples in the dialects of other programs, written by their own writers, read, and calibrated.

python -m tools.lab dialects                      a row for each, as docs/recordings.md has them
python -m tools.lab dialects --only '*ROS*'
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from runpy import run_path
from typing import Annotated, Any

import numpy as np

import mpucal
from mpucal.files import load, open_writer
from mpucal.files.hints import NO_HINTS, Hints
from mpucal.files.rows import Rows

from .runner import Trial, names_of
from .table import Column, Row, first

ROOT = Path(__file__).parents[2]
SESSION = ROOT / "fixtures" / "sessions" / "mpu6050.mcap"
EPOCH_NS = 1_403_636_579_758_555_392
Walk = mpucal.Recording
Write = Callable[[Path, Walk, Any], Any]


@cache
def walk() -> Walk:
    """Return the samples of the session at a constant rate, since some dialects have no times."""
    whole = mpucal.load(SESSION)
    t_ns = np.arange(len(whole)) * 10_000_000
    return Walk.from_arrays(t_ns * 1e-9, whole.acc, whole.gyr, name="walk")


def own(path: Path, w: Walk, _ns: Any) -> None:
    """Write it as mpucal does."""
    with open_writer(path, Rows.of(w), "") as write:
        write(w)


@cache
def dialects() -> dict[str, tuple[str, str, Write, Hints]]:
    """Return for each dialect its writing program, the file's name, what writes it there, and the hints to read it.

    An empty name is the folder itself, which is then what is read. The functions are those of the tests.
    """
    tables, fixtures, logs, loggers, strangers = (
        run_path(str(ROOT / "tests" / "files" / f"{name}.py"))
        for name in ("test_tables", "conftest", "test_logs", "test_loggers", "test_strangers")
    )
    counts, at_100_hz = Hints(rate_hz=100.0, accel_range_g=4.0, gyro_range_dps=500.0), Hints(rate_hz=100.0)

    def table(name: str, **how: Any) -> Write:
        return lambda path, w, ns: tables["DIALECTS"][name](w, ns).to_csv(path, index=False, **how)

    def bag(kind: str) -> Write:
        return lambda path, w, ns: fixtures["write_bag_file"](path, w, ns, kind)

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

    def parquet(path: Path, w: Walk, ns: Any) -> None:
        logs["parquet_of"](w, timestamp=ns).to_parquet(path)

    def in_folder(write: Callable[[Walk, Any, Path], Any]) -> Write:
        return lambda folder, w, ns: write(w, ns, folder)

    return {
        "ROS 2, .mcap": ("rosbags", "walk", bag("mcap"), NO_HINTS),
        "ROS 2, .db3": ("rosbags", "walk", bag("db3"), NO_HINTS),
        "ROS 1, .bag": ("rosbags", "walk.bag", bag("bag"), NO_HINTS),
        "what `mpucal apply` wrote": ("mpucal", "walk.mcap", own, NO_HINTS),
        "PX4, .ulg": ("pyulog", "walk.ulg", ulog, NO_HINTS),
        "Parquet": ("pandas, pyarrow", "walk.parquet", parquet, NO_HINTS),
        **{name: ("pandas", "walk.csv", table(name), NO_HINTS) for name in tables["DIALECTS"]},
        "AndroSensor, `;` and decimal commas": (
            *("pandas", "walk.csv"),
            *(table("AndroSensor", sep=";", decimal=","), NO_HINTS),
        ),
        "phyphox, a folder": ("pandas", "", in_folder(tables["phyphox"]), NO_HINTS),
        "Sensor Logger, a folder": ("pandas", "", in_folder(tables["sensor_logger"]), NO_HINTS),
        "Sensor Logger on iOS, one table": ("pandas", "walk.csv", one_table, NO_HINTS),
        "two tables without names": ("pandas", "", loggers["pair"], NO_HINTS),
        "lines that name each number": ("Python", "walk.txt", labelled, NO_HINTS),
        "MPU6050_raw": ("Python", "walk.txt", raw, counts),
        "a sketch's counts": ("NumPy", "walk.csv", sketch, counts),
        "a matrix of MATLAB without names": (
            *("SciPy", "walk.mat"),
            *(lambda path, w, _: strangers["as_matlabs_matrix"](w, path), NO_HINTS),
        ),
        **{
            Path(name).stem: (
                *("Python", name),
                *(lambda path, w, _, form=form: path.write_text(form(w)), at_100_hz if "board" in name else NO_HINTS),
            )
            for name, form in strangers["FORMS"].items()
        },
    }


def written(name: str, folder: Path, w: Walk) -> Path:
    """Write a dialect into a folder; return the file or folder to read."""
    _, file, write, _ = dialects()[name]
    write(folder / file, w, np.rint(w.t * 1e9).astype(np.int64) + EPOCH_NS)
    return folder / file


def of_dialect(name: str) -> Row:
    """Write, read and calibrate a dialect, and compare with the calibration of the samples themselves."""
    made, (by, *_, hints) = walk(), dialects()[name]
    with tempfile.TemporaryDirectory() as folder:
        read = load(written(name, Path(folder), made), hints)
    of_acc, of_gyr = np.abs(read.acc - made.acc).max(), np.abs(read.gyr - made.gyr).max()
    wanted, found = mpucal.calibrate(made), mpucal.calibrate(read)
    corrected = np.abs(found.apply(read.acc) - wanted.apply(made.acc)).max()
    figures = {"by": by, "samples": f"{of_acc:.1g}, {of_gyr:.1g}", "D": f"{np.abs(found.D - wanted.D).max():.1g}"}
    return Row(name=name, **figures, corrected=f"{corrected:.1g}")


COLUMNS: dict[str, Column] = {
    "written by": first("by"),
    "samples' largest difference, m/s², rad/s": first("samples"),
    "D's": first("D"),
    "corrected samples', m/s²": first("corrected"),
}


def scenarios(*, only: Annotated[str, "those with such names, patterns with ; between"] = "*") -> list[str]:
    """Return the names of dialects."""
    return names_of(dialects())(only)


main = Trial(__doc__, of_dialect, scenarios, COLUMNS)
