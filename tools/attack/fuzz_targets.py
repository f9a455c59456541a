"""Targets of tools/attack/fuzz.py: readers and decoders by name, each with its first corpus.

Mutated bytes would nearly always fail checksums, so the mutated bytes are the content, and the checksums are computed:
of archives and captures here, of frames and packets in fuzz_peers.py.
"""

import io
import json
import struct
import zipfile
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from runpy import run_path

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from mpucal import Calibration
from mpucal.__main__ import run
from mpucal.bridge import messages as wire
from mpucal.bridge.frame import Frame
from mpucal.cli.options import parse_gravity
from mpucal.errors import MpucalError, UsageError
from mpucal.export.forms import FORMS
from mpucal.files import load
from mpucal.files.hints import Hints, parse_columns, parse_units
from mpucal.files.mcap import FORMAT, read_capture
from mpucal.iio.driver import Devices
from mpucal.mavlink.parameters.encoding import read_parameters_file
from mpucal.mavlink.url import parse_url, read_key
from mpucal.page.address import parse_address
from mpucal.result.blob import Blob
from mpucal.result.journal import Journal
from mpucal.result.noise import Noise
from mpucal.session.plan import Plan
from mpucal.simulated.chip import ChipOptions
from mpucal.simulated.vehicle.options import VehicleOptions
from mpucal.sinks.chip import FORMAT as KEPT
from mpucal.sinks.chip import REGISTERS, saved_blocks
from mpucal.sinks.write_back import is_calibration
from mpucal.sources.recorded_parts import split_at_resumes
from mpucal.sources.table import SOURCES

from ..lab.dialects import dialects, walk, written
from . import fuzz_peers as peers
from .fuzz_peers import joined, pieces, tlog

ROOT = Path(__file__).parents[2]
FIXTURES = ROOT / "fixtures"
Run = Callable[[bytes], object]
# topic, time step [ns], length; topic 2 is the metadata of the file
PIECE_OF_CAPTURE = struct.Struct("<BqH")
TOPICS = ("/bus", "/session")
MEMBER = b"\x93NUMPY"
TEXTS: tuple[Callable[[str], object], ...] = (
    ChipOptions.parse,
    VehicleOptions.parse,
    parse_url,
    Devices.parse,
    parse_address,
    parse_columns,
    parse_units,
    parse_gravity,
    *(option.parse for kind in SOURCES for option in (kind.option, *kind.options, *kind.settings)),
)
WORDS = (
    "sim:chip=mpu6500,seed=4,fault=nack@3/gap@9,D=1/0/0/0/1/0/0/0/1,who_am_i=0x70,noise=0.5",
    "sim:seed=7,firmware=px4,INS_ACCOFFS_X=0.1,fault=loss,rotate_at=3",
    "udpout:127.0.0.1:14550",
    "/dev/ttyACM0:115200",
    "accel=iio:device0,gyro=iio:device1",
    "[::1]:8000",
    "t=time_us,ax=AccX,ay=2",
    "t=ms,acc=g,gyr=deg/s",
    "0x68",
    "4,5",
)


def command(*words: str) -> None:
    """Run a command; raise AssertionError if it printed a traceback."""
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()) as err:
        code = run(words)
    if code == 1:
        raise AssertionError(err.getvalue())


def calibration(path: Path) -> None:
    """Read a calibration, and use it as the commands do."""
    command("show", str(path))
    command("diff", str(path), str(path))
    made = Calibration.load(path)
    made.blob()
    for form in FORMS:
        with suppress(MpucalError):
            form.export(made)


def archive(path: Path) -> None:
    """Load the archive whose members have these bytes."""
    data = path.read_bytes()
    with zipfile.ZipFile(path, "w") as file:
        for name, member in zip(("t", "acc", "gyr", "sensor"), data.split(MEMBER)[1:], strict=False):
            file.writestr(f"{name}.npy", MEMBER + member)
    load(path)


def capture(path: Path) -> None:
    """Load the capture whose messages have these bytes."""
    t_ns, messages, meta = 0, [], {}
    for which, step_ns, message in pieces(path.read_bytes(), PIECE_OF_CAPTURE):
        t_ns = (t_ns + step_ns) % (1 << 64)
        if which < len(TOPICS):
            messages.append((which, t_ns, message))
        else:
            key, _, value = message.decode(errors="replace").partition("=")
            meta[key] = value
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start()
        writer.add_metadata(FORMAT, meta)
        channels = [
            writer.register_channel(topic, encoding, 0)
            for topic, encoding in zip(TOPICS, ("protobuf", "json"), strict=True)
        ]
        for which, t_ns, message in messages:
            writer.add_message(channels[which], t_ns, message, t_ns)
        writer.finish()
    read = read_capture(path)
    split_at_resumes([read.records])
    Plan.of_capture(read.meta, read.name)
    load(path)


def taken_apart(path: Path) -> bytes:
    """Return the pieces of a capture, the inverse of `capture`."""
    with path.open("rb") as file:
        reader = make_reader(file)
        rows: list[tuple[int, int, bytes]] = []
        for metadata in reader.iter_metadata():
            rows += [(2, 0, f"{key}={value}".encode()) for key, value in metadata.metadata.items()]
        last_ns = 0
        for _, channel, message in reader.iter_messages(log_time_order=False):
            rows.append((TOPICS.index(channel.topic), message.log_time - last_ns, message.data))
            last_ns = message.log_time
    return joined(PIECE_OF_CAPTURE, [row for row in rows if len(row[2]) < 1 << 16])


def texts(data: bytes) -> None:
    """Parse values of options."""
    text = data.decode(errors="surrogateescape")
    for parse in TEXTS:
        with suppress(UsageError, ValueError):
            parse(text)


def notes(path: Path) -> None:
    """Read the files that a write leaves."""
    with suppress(MpucalError):
        saved_blocks(path)
    is_calibration(path)
    Journal(path).interrupted()


def targets(place: Path) -> dict[str, tuple[Run, list[bytes]]]:
    """Return the targets by name: the function that is run, and its corpus."""
    rows, npz, csv = table(), io.BytesIO(), io.BytesIO()
    np.savez(npz, t=rows[:, 0], acc=rows[:, 1:4], gyr=rows[:, 4:])
    np.savetxt(csv, rows, delimiter=",", header="t,ax,ay,az,gx,gy,gz", comments="")
    with np.load(io.BytesIO(npz.getvalue())) as file, zipfile.ZipFile(npz) as members:
        stored = b"".join(members.read(f"{name}.npy") for name in file.files)
    made = Calibration(D=np.eye(3) * 1.01, b_a=np.array([0.1, -0.2, 0.3])).json().encode()
    blobs = [path.read_bytes() for path in sorted((FIXTURES / "vectors").glob("blob*.bin"))]
    hello = [Frame(kind, n, bytes(range(n))).encode() for n, kind in enumerate(wire.REQUESTS)]
    captures = sorted((FIXTURES / "faults").glob("s*.mcap"))
    kept = {"format": KEPT, "version": 1, "where": "", REGISTERS: {"0x06": "0001"}}
    parameters = [b"# a\nINS_ACCOFFS_X,0.1\n", b"# a\n1\t1\tCAL_ACC0_XOFF\t0.1\t9\n"]
    return {
        "calibration.json": (of_file(calibration, place, "c.json"), [made]),
        "noise.json": (of_file(Noise.load, place, "n.json"), [made, b'{"format": "mpucal.noise", "tau_s": [1.0]}']),
        "notes": (of_file(notes, place, "k.json"), [json.dumps(kept).encode(), b'{"at": "2026-01-01", "a": []}']),
        "parameters": (of_file(read_parameters_file, place, "p.param"), parameters),
        "signing key": (of_file(read_key, place, "key"), [b"00" * 32, b"a phrase"]),
        "texts": (texts, [text.encode() for text in WORDS]),
        "blob": (Blob.decode, blobs),
        "frames": (peers.frames, [b"".join(hello), *hello]),
        "bridge": (peers.bridge, peers.bridge_says()),
        "packets": (peers.packets, [tlog(said) for said in peers.vehicle_says()]),
        "vehicle": (peers.vehicle, peers.vehicle_says()),
        "http": (peers.http, peers.browser_says()),
        "csv": (of_file(load, place, "r.csv"), [csv.getvalue()]),
        "txt": (of_file(load, place, "r.txt"), [csv.getvalue(), b"a/g:\t1\t2\t3\t4\t5\t6\n" * 30]),
        "npz": (of_file(load, place, "r.npz"), [npz.getvalue()]),
        "npz's members": (of_file(archive, place, "r.npz"), [stored]),
        "mcap": (of_file(load, place, "r.mcap"), [path.read_bytes() for path in captures]),
        "mcap's messages": (of_file(capture, place, "r.mcap"), [taken_apart(path) for path in captures]),
        "tlog": (of_file(load, place, "r.tlog"), [tlog(said) for said in peers.vehicle_says()]),
        "tlog's packets": (lambda data: of_file(load, place, "p.tlog")(tlog(data)), peers.vehicle_says()),
        "dataflash": (of_file(load, place, "r.bin"), [b"\xa3\x95\x80" + bytes(range(86)) * 9, blobs[0]]),
        "dataflash of a flight": (of_file(load, place, "r.bin"), [flight()]),
        **{
            name: (of_file(load, place, f"r{path.suffix}", hints), [path.read_bytes()])
            for name, (path, hints) in written_dialects(place).items()
        },
    }


def table() -> np.ndarray:
    """Return a short recording (n, 7)."""
    t = np.arange(300) * 0.01
    return np.column_stack((t, np.tile((0.1, -0.2, 9.8), (300, 1)), np.sin(t)[:, None] * (1.0, 0.5, -0.5)))


def of_file(read: Callable[..., object], place: Path, name: str, *more: object) -> Run:
    """Return a function that writes bytes to a file of that name and reads it."""
    path = place / name

    def run(data: bytes) -> object:
        path.write_bytes(data)
        return read(path, *more)

    return run


def flight() -> bytes:
    """Return a dataflash log of two IMUs, by the writer of the tests."""
    log = run_path(str(ROOT / "tests" / "files" / "test_dataflash.py"))["Dataflash"]()
    log.describe("FMT", 0x80, "BBnNZ", "Type,Length,Name,Format,Columns")
    log.describe("PARM", 0x81, "QNff", "TimeUS,Name,Value,Default")
    log.describe("IMU", 0x82, "QBffffffIIfBBHH", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz")
    log.add("PARM", 0, b"INS_ACCOFFS_X", 0.05, 0.0)
    for t, *row in table()[:40]:
        for imu in range(2):
            log.add("IMU", round(t * 1e6), imu, *row[3:], *row[:3], 0, 0, 31.5, 1, 1, 1000, 1000)
    data: bytes = log.bytes()
    return data


def written_dialects(place: Path) -> dict[str, tuple[Path, Hints]]:
    """Return a file of some 60 samples of each dialect by name; an archive of a folder, and the data file of a bag."""
    found, short = {}, walk().part(2000, 2060)
    for number, (name, (*_, hints)) in enumerate(dialects().items()):
        folder = place / str(number)
        folder.mkdir()
        path = written(name, folder, short)
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
