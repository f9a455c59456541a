"""A session's samples in the formats of other programs, written by their own writers, read, and calibrated.

python -m tools.lab dialects                      a row for each, as docs/recordings.md has them
python -m tools.lab dialects --only '*ROS*'
"""

import tempfile
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from runpy import run_path
from typing import Annotated, Any

import numpy as np

import mpucal
from mpucal.files import load, open_writer
from mpucal.files.hints import NO_HINTS, Hints, parse_columns, parse_units
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
    tables, arrays, folders, px4, fixtures = (
        run_path(str(ROOT / "tests" / "files" / f"{name}.py"))
        for name in ("test_tables", "test_arrays", "test_folders", "test_px4", "conftest")
    )

    def bag(kind: str) -> Write:
        return lambda path, w, ns: fixtures["write_bag_file"](path, w, ns, kind)

    def ulog(path: Path, w: Walk, ns: Any) -> None:
        t_us = (ns - ns[0]) // 1000 + 5_000_000
        sensors = [(f"sensor_{name}", 0, px4["imu"](t_us, of)) for name, of in (("accel", w.acc), ("gyro", w.gyr))]
        px4["ulog"](path, *sensors)

    return {
        "ROS 2, .mcap": ("rosbags", "walk", bag("mcap"), NO_HINTS),
        "ROS 2, .db3": ("rosbags", "walk", bag("db3"), NO_HINTS),
        "ROS 1, .bag": ("rosbags", "walk.bag", bag("bag"), NO_HINTS),
        "what `mpucal apply` wrote": ("mpucal", "walk.mcap", own, NO_HINTS),
        "PX4, .ulg": ("pyulog", "walk.ulg", ulog, NO_HINTS),
        **{
            name: (WRITERS.get(file[-4:], "Python"), file, how, NO_HINTS)
            for name, (file, how, _) in arrays["WRITTEN"].items()
        },
        **{name: ("pandas", "", how, NO_HINTS) for name, (how, _) in folders["WRITTEN"].items()},
        **{
            name: ("Python", form.file, form.write, hints_of(form.hints or {}))
            for name, form in tables["FORMS"].items()
        },
    }


WRITERS = {".npy": "NumPy", ".npz": "NumPy", ".mat": "SciPy", "quet": "pandas, pyarrow"}


def hints_of(words: dict[str, Any]) -> Hints:
    """Return the hints of words of mpucal.load."""
    scales = (words.get(key) for key in ("accel_range", "gyro_range", "rate"))
    columns, units = words.get("columns"), words.get("units")
    return Hints(None, None, parse_columns(columns) if columns else {}, parse_units(units) if units else {}, *scales)


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


def named(patterns: str) -> list[str]:
    """Return the names of the dialects that match patterns; see names_of."""
    return names_of(dialects())(patterns)


def scenarios(*, only: Annotated[Sequence[str], named, "patterns, with ; between"] = "*") -> Sequence[str]:
    """Return the names of dialects."""
    return only


main = Trial(__doc__, of_dialect, scenarios, COLUMNS)
