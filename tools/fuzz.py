"""Readers and decoders on mutated bytes: nothing but the package's own errors comes out, and within a second or two.

    python tools/fuzz.py --seconds 60 [TARGET ...]

Each target has a corpus of the fixtures, of files that are made here, or of one in a dialect of tools/dialects.py, as
rosbags, pyulog, pandas and others write it, and gets bytes of it that are damaged as in tools/campaign_recordings.py,
cut, joined, or with one piece in the place of another's. A line counts its executions.
What it should not have raised is printed with the seed that makes it again (--first SEED --seconds 0 TARGET).
"""

from __future__ import annotations

import argparse
import io
import signal
import sys
import time
import traceback
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType

import numpy as np
from campaign_recordings import OF_BYTES
from dialects import dialects, walk

from mpucal import Calibration
from mpucal.errors import MpucalError
from mpucal.files import load
from mpucal.files.hints import NO_HINTS, Hints
from mpucal.mavlink.dialect import Parser, dialect
from mpucal.result.blob import Blob, BlobError
from mpucal.result.noise import Noise
from mpucal.sources.bridge import messages as wire
from mpucal.sources.bridge.frame import Deframer, Frame

FIXTURES = Path(__file__).parents[1] / "fixtures"
LONGEST_S = 20
EXPECTED = (MpucalError, BlobError, wire.MessageError)
Run = Callable[[bytes], object]


def table() -> np.ndarray:
    """(n, 7) a short recording."""
    t = np.arange(300) * 0.01
    return np.column_stack((t, np.tile((0.1, -0.2, 9.8), (300, 1)), np.sin(t)[:, None] * (1.0, 0.5, -0.5)))


def of_file(read: Callable[..., object], place: Path, name: str, *more: object) -> Run:
    """Of bytes as a file of that name."""
    path = place / name

    def run(data: bytes) -> object:
        path.write_bytes(data)
        return read(path, *more)

    return run


def frames(data: bytes) -> None:
    """What comes over a serial line."""
    for frame in Deframer().feed(data):
        kind = wire.REQUESTS.get(frame.type)
        if kind is not None:
            kind.decode(frame.payload)


def packets(data: bytes) -> None:
    """What comes as a datagram, and what comes as a stream."""
    for packet in Parser(dialect().MAVLink(None)).datagram(data):
        packet.message.to_dict()
    list(Parser(dialect().MAVLink(None)).stream(data))


def heartbeats() -> bytes:
    """A few packets."""
    link = dialect().MAVLink(None, 1, 1)
    said = [link.heartbeat_encode(2, 3, 0, 0, 3), link.raw_imu_encode(1, 2, 3, 4, 5, 6, 7, 8, 9, 10)]
    said.append(link.param_value_encode(b"INS_ACCOFFS_X", 0.1, 9, 3, 1))
    return b"".join(bytes(message.pack(link)) for message in said)


def targets(place: Path) -> dict[str, tuple[Run, list[bytes]]]:
    """By name: what is run, and its corpus."""
    rows, npz, csv = table(), io.BytesIO(), io.BytesIO()
    np.savez(npz, t=rows[:, 0], acc=rows[:, 1:4], gyr=rows[:, 4:])
    np.savetxt(csv, rows, delimiter=",", header="t,ax,ay,az,gx,gy,gz", comments="")
    made = Calibration(D=np.eye(3) * 1.01, b_a=np.array([0.1, -0.2, 0.3])).json().encode()
    blobs = [path.read_bytes() for path in sorted((FIXTURES / "vectors").glob("blob*.bin"))]
    hello = [Frame(kind, n, bytes(range(n))).encode() for n, kind in enumerate(wire.REQUESTS)]
    captures = [path.read_bytes() for path in sorted((FIXTURES / "faults").glob("s*.mcap"))]
    return {
        "calibration.json": (of_file(Calibration.load, place, "c.json"), [made]),
        "noise.json": (of_file(Noise.load, place, "n.json"), [made, b'{"format": "mpucal.noise", "tau_s": [1.0]}']),
        "blob": (Blob.decode, blobs),
        "frames": (frames, [b"".join(hello), *hello]),
        "packets": (packets, [heartbeats()]),
        "csv": (of_file(load, place, "r.csv"), [csv.getvalue()]),
        "txt": (of_file(load, place, "r.txt"), [csv.getvalue(), b"a/g:\t1\t2\t3\t4\t5\t6\n" * 30]),
        "npz": (of_file(load, place, "r.npz"), [npz.getvalue()]),
        "mcap": (of_file(load, place, "r.mcap"), captures),
        "tlog": (of_file(load, place, "r.tlog"), [bytes(8) + heartbeats()]),
        "dataflash": (of_file(load, place, "r.bin"), [b"\xa3\x95\x80" + bytes(range(86)) * 9, blobs[0]]),
        **{name: of_dialect(place, *written) for name, written in written_dialects(place).items()},
    }


def written_dialects(place: Path) -> dict[str, tuple[Path, Hints]]:
    """Name -> a file of some 60 samples; of what is a folder, an archive, or the bag's file."""
    found, short = {}, walk().part(2000, 2060)
    ns = np.rint(short.t * 1e9).astype(np.int64) + 1_700_000_000_000_000_000
    for number, (name, (_, write, hints)) in enumerate(dialects().items()):
        folder = place / str(number)
        folder.mkdir()
        path = write(folder, short, ns)
        children = sorted(path.iterdir()) if path.is_dir() else []
        if path / "metadata.yaml" in children:
            path = next(child for child in children if child.suffix != ".yaml")
        elif children:
            path = folder / "tables.zip"
            with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
                for child in children:
                    archive.write(child, child.name)
        found[name] = path, hints
    return found


def of_dialect(place: Path, path: Path, hints: Hints = NO_HINTS) -> tuple[Run, list[bytes]]:
    """Its reader, and its file as the corpus."""
    return of_file(load, place, f"r{path.suffix}", hints), [path.read_bytes()]


def mutated(corpus: Sequence[bytes], seed: int) -> bytes:
    """Damaged by its seed."""
    rng = np.random.default_rng(seed)
    data = bytearray(corpus[rng.integers(len(corpus))])
    if rng.random() < 0.2:
        data += corpus[rng.integers(len(corpus))]
    for _ in range(rng.integers(1, 4)):
        if data:
            OF_BYTES[rng.integers(len(OF_BYTES))](data, rng)
    return bytes(data)


def fuzz(name: str, run: Run, corpus: Sequence[bytes], first: int, seconds: float) -> tuple[int, int]:
    """Executions, and how many raised what they should not."""
    until, seed, wrong = time.monotonic() + seconds, first, 0
    while True:
        signal.setitimer(signal.ITIMER_VIRTUAL, LONGEST_S)
        try:
            run(mutated(corpus, seed))
        except EXPECTED:
            pass
        except Exception:
            wrong += 1
            print(f"{name}, seed {seed}:\n{traceback.format_exc(limit=-4)}", flush=True)
        seed += 1
        if time.monotonic() >= until:
            return seed - first, wrong


def too_long(_signal: int, _frame: FrameType | None) -> None:
    """It takes longer than any reader may."""
    raise TimeoutError(f"longer than {LONGEST_S} s of processor time")


def main() -> int:
    """Run them; 1 where one raised what it should not."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("targets", nargs="*", metavar="TARGET")
    parser.add_argument("--seconds", type=float, default=60.0, help="of each target")
    parser.add_argument("--first", type=int, default=time.time_ns() // 86_400_000_000_000 * 10**7)
    asked = parser.parse_args()
    signal.signal(signal.SIGVTALRM, too_long)
    bad = 0
    with TemporaryDirectory() as place:
        of = targets(Path(place))
        for name in asked.targets or of:
            count, wrong = fuzz(name, *of[name], asked.first, asked.seconds)
            bad += wrong
            print(f"{name:<44}{count:>9} executions, seeds from {asked.first} on: {wrong} wrong", flush=True)
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
