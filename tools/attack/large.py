"""Small files that grow large: what reading each takes, of memory and time.

    .venv/bin/python -m tools.attack large [--files N] [--seed N] [--most-mb MB] [--seconds S]

Archives of zeros, captures and bags with chunks that unpack to gigabytes or say so, tables that repeat a line or end
nowhere, and logs with a hole. Each is calibrated in a process of its own; of each kind a line gives the largest peak
and the longest processor time. Exit code 1: a peak beyond 600 MB, a trace, or more than 30 s of processor time.
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import struct
import time
import zipfile
from collections.abc import Callable, Iterable
from itertools import takewhile
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from zstandard import ZstdCompressor

from tools.attack.shared import become

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
    """An .npz of zeros, or of a length that it has not."""
    samples, said, more = draw.randrange(10_000, 1_000_000), draw.choice((1, 1, 1000)), draw.choice((1, 1, 70))
    with zipfile.ZipFile(path.with_suffix(".npz"), "w", zipfile.ZIP_DEFLATED) as file:
        for key, shape in (
            ("t", (samples,)),
            ("acc", (samples, 3)),
            ("gyr", (samples, 3)),
            ("sensor", (more * samples,)),
        ):
            head = {"descr": "<f8", "fortran_order": False, "shape": (shape[0] * said, *shape[1:])}
            with file.open(f"{key}.npy", "w") as member:
                np.lib.format.write_array_header_1_0(member, head)
                _zeros(member.write, 8 * int(np.prod(shape)))


def phone(path: Path, draw: random.Random) -> None:
    """A .zip of two tables that repeat a line."""
    line = b"0,0,0,9.8\n" * 10_000
    with zipfile.ZipFile(path.with_suffix(".zip"), "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
        for name in ("Accelerometer.csv", "Gyroscope.csv"):
            with file.open(name, "w") as member:
                member.write(b"time,x,y,z\n")
                for _ in range(draw.randrange(10, 1000)):
                    member.write(line)


def capture(path: Path, draw: random.Random) -> None:
    """A capture with chunks that unpack to more than they, or their heads, say."""
    data, at = CAPTURE.read_bytes(), 8
    while data[at] != CHUNK:
        at += 9 + struct.unpack_from("<Q", data, at + 1)[0]
    size = draw.choice((1, 30, 63, 65, 500, 2000)) * MB
    said = draw.choice((size, size, 1000, 1 << 40))
    bomb = _chunk(size, said) * draw.randrange(1, max(2, 500 * MB // size))
    path.with_suffix(".mcap").write_bytes(data[:at] + bomb + data[at:])


def table(path: Path, draw: random.Random) -> None:
    """A table that repeats a line, or ends in a hole of gigabytes."""
    ending, head = draw.choice(list(LINES.items()))
    separator = head[-3:-2] if ending == ".csv" else head[4:5]
    line = separator.join([b"0"] * 7) + b"\n"
    with path.with_suffix(ending).open("wb") as file:
        file.write(head + line * draw.choice((0, 10, 300_000)))
        if draw.random() < 0.6:
            file.truncate(draw.choice((8 * MB, 300 * MB, 4000 * MB, 50_000 * MB)))


def log(path: Path, draw: random.Random) -> None:
    """A log with a hole of gigabytes."""
    ending, head = draw.choice(
        ((".tlog", b""), (".ulg", b"ULog\1\x12\x35\1" + bytes(8)), (".log", b"a/g:\t1\t2\t3\t4\t5\t6\n"))
    )
    with path.with_suffix(ending).open("wb") as file:
        file.write(head)
        file.truncate(draw.choice((8 * MB, 300 * MB, 4000 * MB, 50_000 * MB)))


KINDS: tuple[Callable[[Path, random.Random], None], ...] = (archive, phone, capture, table, log)


def _zeros(put: Callable[[bytes], object], count: int) -> None:
    while count:
        put(bytes(min(count, MB)))
        count -= min(count, MB)


def _chunk(size: int, said: int) -> bytes:
    """A chunk of one record that nobody knows."""
    parts = [b""]
    packer = ZstdCompressor().compressobj(size=size)
    parts.append(packer.compress(bytes([UNKNOWN]) + struct.pack("<Q", size - 9)))
    _zeros(lambda zeros: parts.append(packer.compress(zeros)), size - 9)
    packed = b"".join([*parts, packer.flush()])
    head = struct.pack("<QQQI", 0, 0, said, 0) + struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", len(packed))
    return bytes([CHUNK]) + struct.pack("<Q", len(head) + len(packed)) + head + packed


def read(words: Iterable[str], folder: Path) -> tuple[int, float, str]:
    """Peak [MB] and processor time [s] of a command, and what was wrong with it."""
    said = folder.parent / "said"
    process = os.fork()
    if process == 0:
        resource.setrlimit(resource.RLIMIT_CPU, (LONGEST_S, LONGEST_S))
        become(list(words), folder, said)
    _, status, used = os.wait4(process, 0)
    words_said = said.read_text(errors="replace")
    code, peak = os.waitstatus_to_exitcode(status), used.ru_maxrss >> 10
    wrong = f"exit code {code}: {words_said[-300:]}" if code not in (0, 2, 3, 5) or "Traceback" in words_said else ""
    return peak, used.ru_utime + used.ru_stime, wrong or (f"{peak} MB" if peak > PEAK_MB else "")


def main() -> int:
    """Read so many; 1 where one took too much."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--files", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--most-mb", default="512")
    parser.add_argument("--seconds", type=float, default=3600.0, help="begin no file after these")
    asked = parser.parse_args()
    worst: dict[str, tuple[int, int, float, str]] = {}
    until_s = time.monotonic() + asked.seconds
    for number in takewhile(lambda _: time.monotonic() < until_s, range(asked.files)):
        kind, draw = KINDS[number % len(KINDS)], random.Random(asked.seed * 1_000_000 + number)
        with TemporaryDirectory() as place:
            (folder := Path(place) / "here").mkdir()
            kind(folder / "a", draw)
            (file,) = folder.iterdir()
            peak, seconds, wrong = read(("calibrate", file.name, "--most-mb", asked.most_mb), folder)
        count, *before, said = worst.get(kind.__name__, (0, 0, 0.0, ""))
        said = said or (f"number {number}, {file.name}: {wrong}" if wrong else "")
        worst[kind.__name__] = count + 1, max(peak, int(before[0])), max(seconds, before[1]), said
    for name, (count, peak, seconds, said) in worst.items():
        print(f"{name:10} {count:4} files, at most {peak:4} MB and {seconds:5.1f} s {said}")
    return int(any(said for *_, said in worst.values()))
