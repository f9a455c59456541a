"""Recordings whose bytes, bits, rows and values are damaged, calibrated: tools/lab/campaign.py --recordings."""

import io
import json
import resource
from collections.abc import Callable, Iterable
from contextlib import redirect_stderr, redirect_stdout
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mpucal.__main__ import run
from mpucal.files import load, open_writer
from mpucal.files.rows import Rows
from mpucal.files.vehicle_logs import tlog_of
from tools.processes import Child, lasting_folder

from .campaign_judge import FOLDER, judge_files
from .table import Row

MEMORY = 4 << 30
MOST_BLOWS = 4
SOURCES = {
    "mcap": ["--bus", "sim:seed=4", "--rate", "25"],
    "npz": ["--bus", "sim:seed=5,chip=mpu6500", "--rate", "50"],
    "csv": ["--bus", "sim:seed=6,chip=clone98", "--rate", "25"],
    "tlog": ["--mavlink", "sim:seed=7", "--rate", "25"],
}
# a log is decoded packet by packet, and takes ten times as long
ORDER = (*("mcap", "npz", "csv") * 3, "tlog")
ODD = (np.nan, np.inf, 1e300, -1e300, 5e-324, 0.0, -32768.0, 1e19)
Rng = np.random.Generator
Table = list[np.ndarray]


def bits(data: bytearray, rng: Rng) -> None:
    """Flip up to 30 bits."""
    for at in rng.integers(0, len(data), rng.integers(1, 31)):
        data[at] ^= 1 << rng.integers(8)


def some_bytes(data: bytearray, rng: Rng) -> None:
    """Replace up to 20 bytes."""
    for at in rng.integers(0, len(data), rng.integers(1, 21)):
        data[at] = rng.integers(256)


def cut(data: bytearray, rng: Rng) -> None:
    """Cut the end off."""
    del data[rng.integers(len(data)) :]


def hole(data: bytearray, rng: Rng) -> None:
    """Set a page to zeros, as if it never reached the disk."""
    at = int(rng.integers(len(data)))
    size = min(4096, len(data) - at)
    data[at : at + size] = bytes(size)


def moved(data: bytearray, rng: Rng) -> None:
    """Write a run of bytes to another place."""
    a, b = rng.integers(0, len(data), 2)
    size = int(rng.integers(1, 2000))
    data[a : a + size] = data[b : b + size]


def lost(rows: Table, rng: Rng) -> Table:
    """Remove a run of rows."""
    at = rng.integers(len(rows))
    return rows[:at] + rows[at + rng.integers(1, 200) :]


def twice(rows: Table, rng: Rng) -> Table:
    """Repeat a run of rows."""
    at = rng.integers(len(rows))
    return rows[:at] + rows[max(0, int(at - rng.integers(1, 100))) :]


def swapped(rows: Table, rng: Rng) -> Table:
    """Swap two rows."""
    a, b = rng.integers(0, len(rows), 2)
    rows[a], rows[b] = rows[b], rows[a]
    return rows


def odd(rows: Table, rng: Rng) -> Table:
    """Set up to 5 values to numbers that no sensor reads."""
    for at in rng.integers(0, len(rows), rng.integers(1, 6)):
        rows[at][rng.integers(len(rows[at]))] = rng.choice(ODD)
    return rows


def spikes(rows: Table, rng: Rng) -> Table:
    """Move up to 20 values of one column far off."""
    column, size = rng.integers(1, 7), 10.0 ** rng.uniform(-1, 2)
    for at in rng.integers(0, len(rows), rng.integers(1, 21)):
        rows[at][column] += size * rng.normal()
    return rows


def stuck(rows: Table, rng: Rng) -> Table:
    """Repeat a value of a column for a while."""
    column, at = rng.integers(1, 7), int(rng.integers(len(rows)))
    for row in rows[at : at + int(rng.integers(2, 400))]:
        row[column] = rows[at][column]
    return rows


def shifted(rows: Table, rng: Rng) -> Table:
    """Make the clock jump, forwards or backwards."""
    by_s = rng.normal() * 10.0 ** rng.uniform(-2, 4)
    for row in rows[rng.integers(len(rows)) :]:
        row[0] += by_s
    return rows


OF_BYTES = (bits, some_bytes, cut, hole, moved)
OF_ROWS = (lost, twice, swapped, odd, spikes, stuck, shifted)


class Damaged(NamedTuple):
    """Recording to be damaged: what `number` draws of a file, and the truth (D, b_a) of its sensor."""

    number: int
    kind: str
    path: Path
    truth: tuple[np.ndarray, np.ndarray]

    def truths(self, *_: object) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return the truth, whatever was damaged."""
        return [self.truth]


def originals(numbers: Iterable[int]) -> list[Damaged]:
    """Record in each format that is asked for; return the cases."""
    made, place = dict[str, tuple[Path, tuple[np.ndarray, np.ndarray]]](), lasting_folder()
    kinds = [ORDER[number % len(ORDER)] for number in numbers]
    for kind in sorted(set(kinds)):
        folder = place / kind
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            run(["session", *SOURCES[kind], "-o", str(folder), "--yes", "--no-write"])
        truth, path = json.loads((folder / "truth.json").read_text()), folder / f"capture.{kind}"
        if kind == "tlog":
            path.write_bytes(tlog_of(folder / "capture.mcap"))
        elif kind != "mcap":
            rows = Rows.of(load(folder / "capture.mcap"))
            with open_writer(path, rows, "") as write:
                for samples in rows.runs:
                    write(samples)
        made[kind] = path, (np.array(truth["D"]), np.array(truth["b_a"]))
    return [Damaged(number, kind, *made[kind]) for number, kind in zip(numbers, kinds, strict=True)]


def damaged(path: Path, number: int) -> tuple[list[str], bytes]:
    """Return the kinds of damage that the number draws, and the damaged file."""
    rng = np.random.default_rng(number)
    kinds: list[Callable[..., Any]] = []
    data = bytearray(path.read_bytes())
    if path.suffix in (".npz", ".csv") and rng.random() < 0.7:
        rows = [row.copy() for row in _table(path)]
        kinds = list(rng.choice(np.array(OF_ROWS, object), rng.integers(1, MOST_BLOWS + 1)))
        for kind in kinds:
            rows = kind(rows, rng) if rows else rows
        data = bytearray(_file(path.suffix, np.array(rows).reshape(-1, 7)))
    if not kinds or rng.random() < 0.1:
        more = list(rng.choice(np.array(OF_BYTES, object), rng.integers(1, MOST_BLOWS)))
        for kind in more:
            if data:
                kind(data, rng)
        kinds += more
    return [kind.__name__ for kind in kinds], bytes(data)


@cache
def _table(path: Path) -> np.ndarray:
    recording = load(path)
    return np.column_stack((recording.t, recording.acc, recording.gyr))


def _file(suffix: str, rows: np.ndarray) -> bytes:
    made = io.BytesIO()
    if suffix == ".npz":
        np.savez(made, t=rows[:, 0], acc=rows[:, 1:4], gyr=rows[:, 4:])
    else:
        np.savetxt(made, rows, delimiter=",", header="t,ax,ay,az,gx,gy,gz", comments="")
    return made.getvalue()


def calibrated(file: Path) -> int:
    """Calibrate within a limit of memory; return the exit code, and leave calibration.json."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    with redirect_stdout(io.StringIO()) as out:
        code = run(["calibrate", str(file), "--json"])
    if out.getvalue():
        Path(FOLDER, "calibration.json").write_text(out.getvalue())
    return code


def of_recording(case: Damaged, here: Path) -> Row:
    """Damage a recording, calibrate and judge it."""
    kinds, data = damaged(case.path, case.number)
    (here / FOLDER).mkdir()
    (file := here / f"damaged.{case.kind}").write_bytes(data)
    done = Child(partial(calibrated, file), here, here / "err").go().wait()
    return judge_files(f"r{case.number}", here, done, kinds, case)
