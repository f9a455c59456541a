"""Small files that grow large: the memory and time that reading each takes.

    python -m tools.attack large [--files N] [--seed N] [--most-mb MB] [--seconds S]

Archives of zeros, captures and bags whose chunks unpack, or claim to unpack, to gigabytes, tables that repeat a line
or do not end, and logs with a hole. Each is calibrated in a process of its own; a line for each kind gives the largest
peak and the longest processor time. Exit code 1: a peak beyond 600 MB, a traceback, or more than 30 s of processor
time.
"""

from __future__ import annotations

import argparse
import random
import struct
import time
import zipfile
from collections.abc import Callable
from functools import partial
from itertools import takewhile
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from zstandard import ZstdCompressor

from mpucal.__main__ import run
from tools.lab.table import grouped, over, show, table
from tools.processes import Child

CAPTURE = Path(__file__).parents[2] / "fixtures" / "sessions" / "enter.mcap"
PEAK_MB, LONGEST_S = 600, 30
MB = 1 << 20
CHUNK, UNKNOWN = 6, 0x80
LINES = {
    ".csv": b"t,ax,ay,az,gx,gy,gz\n",
    ".tsv": b"time\tax\tay\taz\tgx\tgy\tgz\n",
    ".txt": b"time;ax;ay;az;gx;gy;gz\n",
}


def archive(path: Path, draw: random.Random) -> None:
    """Write an .npz of zeros, or with a wrong length in its header."""
    samples, said, more = draw.randrange(10_000, 1_000_000), draw.choice((1, 1, 1000)), draw.choice((1, 1, 70))
    with zipfile.ZipFile(path.with_suffix(".npz"), "w", zipfile.ZIP_DEFLATED) as file:
        shapes = {"t": (samples,), "acc": (samples, 3), "gyr": (samples, 3), "sensor": (more * samples,)}
        for key, shape in shapes.items():
            head = {"descr": "<f8", "fortran_order": False, "shape": (shape[0] * said, *shape[1:])}
            with file.open(f"{key}.npy", "w") as member:
                np.lib.format.write_array_header_1_0(member, head)
                _zeros(member.write, 8 * int(np.prod(shape)))


def phone(path: Path, draw: random.Random) -> None:
    """Write a .zip of two tables that repeat a line."""
    line = b"0,0,0,9.8\n" * 10_000
    with zipfile.ZipFile(path.with_suffix(".zip"), "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
        for name in ("Accelerometer.csv", "Gyroscope.csv"):
            with file.open(name, "w") as member:
                member.write(b"time,x,y,z\n")
                for _ in range(draw.randrange(10, 1000)):
                    member.write(line)


def capture(path: Path, draw: random.Random) -> None:
    """Write a capture with chunks that unpack to a large size, or state a wrong one."""
    data, at = CAPTURE.read_bytes(), 8
    while data[at] != CHUNK:
        at += 9 + struct.unpack_from("<Q", data, at + 1)[0]
    size = draw.choice((1, 30, 63, 65, 500, 2000)) * MB
    said = draw.choice((size, size, 1000, 1 << 40))
    bomb = _chunk(size, said) * draw.randrange(1, max(2, 500 * MB // size))
    path.with_suffix(".mcap").write_bytes(data[:at] + bomb + data[at:])


def text_table(path: Path, draw: random.Random) -> None:
    """Write a table that repeats a line, or ends in a hole of gigabytes."""
    ending, head = draw.choice(list(LINES.items()))
    separator = head[-3:-2] if ending == ".csv" else head[4:5]
    line = separator.join([b"0"] * 7) + b"\n"
    with path.with_suffix(ending).open("wb") as file:
        file.write(head + line * draw.choice((0, 10, 300_000)))
        if draw.random() < 0.6:
            file.truncate(draw.choice((8 * MB, 300 * MB, 4000 * MB, 50_000 * MB)))


def log(path: Path, draw: random.Random) -> None:
    """Write a log with a hole of gigabytes."""
    ending, head = draw.choice(
        ((".tlog", b""), (".ulg", b"ULog\1\x12\x35\1" + bytes(8)), (".log", b"a/g:\t1\t2\t3\t4\t5\t6\n"))
    )
    with path.with_suffix(ending).open("wb") as file:
        file.write(head)
        file.truncate(draw.choice((8 * MB, 300 * MB, 4000 * MB, 50_000 * MB)))


KINDS: tuple[Callable[[Path, random.Random], None], ...] = (archive, phone, capture, text_table, log)


def _zeros(put: Callable[[bytes], object], count: int) -> None:
    while count:
        put(bytes(min(count, MB)))
        count -= min(count, MB)


def _chunk(size: int, said: int) -> bytes:
    """Return a chunk with one record of an unknown kind."""
    packer = ZstdCompressor().compressobj(size=size)
    parts = [packer.compress(bytes([UNKNOWN]) + struct.pack("<Q", size - 9))]
    _zeros(lambda zeros: parts.append(packer.compress(zeros)), size - 9)
    packed = b"".join([*parts, packer.flush()])
    head = struct.pack("<QQQI", 0, 0, said, 0) + struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", len(packed))
    return bytes([CHUNK]) + struct.pack("<Q", len(head) + len(packed)) + head + packed


class Read(NamedTuple):
    """A file that was read: its kind, the peak [MB] and processor time [s] of that, and what was wrong with it."""

    kind: str
    mb: int
    seconds: float
    wrong: str


def read(number: int, seed: int, most_mb: str) -> Read:
    """Make a file, and calibrate it in a process of its own."""
    kind, draw = KINDS[number % len(KINDS)], random.Random(seed * 1_000_000 + number)
    with TemporaryDirectory() as place:
        (folder := Path(place) / "here").mkdir()
        kind(folder / "a", draw)
        (file,) = folder.iterdir()
        calibrate = partial(run, ["calibrate", file.name, "--most-mb", most_mb])
        done = Child(calibrate, folder, Path(place) / "said", LONGEST_S).go().wait(float("inf"))
    wrong = done.wrong((0, 2, 3, 5), (0, 2, 5)) or ([f"{done.peak_mb} MB"] if done.peak_mb > PEAK_MB else [])
    said = f"number {number}, {file.name}: {wrong[0]}" if wrong else ""
    return Read(kind.__name__, done.peak_mb, done.cpu_s, said)


COLUMNS = {
    "files": len,
    "at most MB": over("mb", max),
    "s": over("seconds", max),
    "wrong": lambda of: next((each.wrong for each in of if each.wrong), ""),
}


def main() -> int:
    """Read the files; return 1 if one took too much memory or time."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--files", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--most-mb", default="512")
    parser.add_argument("--seconds", type=float, default=3600.0, help="begin no file after these")
    asked = parser.parse_args()
    until_s = time.monotonic() + asked.seconds
    numbers = takewhile(lambda _: time.monotonic() < until_s, range(asked.files))
    done = [read(number, asked.seed, asked.most_mb) for number in numbers]
    show(table(grouped(done, "kind"), COLUMNS))
    return int(any(each.wrong for each in done))
