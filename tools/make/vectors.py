"""Write the golden vectors of firmware_protocol.md: python -m tools.make vectors [FOLDER].

The blob_*.json beside each blob_*.bin says what a reader must find in it, or why it must refuse it. Each line_*.bin
holds bytes on a serial line, and the line_*.json beside it the frames that a receiver must find. Each exchange_*.json
holds requests of a host and the replies of the bridge; clock_*.json the values that a narrow clock shows, and the 32
bits that the bridge must make of them.
"""

import json
import math
import struct
import tomllib
import zlib
from dataclasses import asdict, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from mpucal.bridge import messages as wire
from mpucal.bridge.doctor import EXCHANGES as EXCHANGES_FILE
from mpucal.bridge.frame import Frame, stuff
from mpucal.data import GYRO_COUNTS
from mpucal.result.blob import Blob

FOLDER = Path(__file__).parents[2] / "fixtures" / "vectors"

# every number is one that float32 holds exactly, so that the .json needs no tolerance
MEASURED = Blob(
    who_am_i=0x68,
    accel_range_g=4.0,
    gyro_range_dps=500.0,
    D=(1.015625, 0.0078125, -0.00390625, 0.01171875, 0.9921875, 0.015625, -0.0078125, 0.00390625, 1.03125),
    b_a=(0.25, -0.375, 0.8125),
    gravity=9.8125,
    temperature_c=31.25,
    created="2024-05-17T09:30:00+00:00",
    applied_b_a=(0.0, 0.0, 0.0),
    K=(1.0078125, 0.001953125, 0.0, 0.001953125, 0.99609375, -0.00390625, 0.0, -0.00390625, 1.0),
    b_omega=(0.015625, -0.03125, 0.0078125),
)
UNKNOWN = replace(
    MEASURED,
    who_am_i=0,
    accel_range_g=0.0,
    gyro_range_dps=0.0,
    gravity=math.nan,
    temperature_c=math.nan,
    created="",
    K=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
    b_omega=(math.nan,) * 3,
)
APPLIED = replace(MEASURED, who_am_i=0x70, applied_b_a=(0.234375, -0.3671875, 0.8046875))
SLOPED = replace(MEASURED, b_a_slope=(0.0078125, -0.001953125, 0.015625), temperature_range_c=(10.5, 52.25))
# two a degree outside the range, where b_a(T) is constant, and one inside
TEMPERATURES_C = (9.5, 40.0, 53.25)
Y = (0.5, -1.25, 10.5)
COUNTED = replace(SLOPED, gyro_counts=GYRO_COUNTS)
# as of libraries that take 32768 counts as full scale
COUNTED_OTHERWISE = replace(MEASURED, gyro_counts=32768.0)
# counts of the gyroscope
COUNTS = (3000, -20000, 32767)


def sealed(body: bytes, length: int | None = None) -> bytes:
    """Return `body` with the right length and CRC-32; `length` : write this length instead."""
    whole = bytearray(body)
    struct.pack_into("<H", whole, 6, len(whole) + 4 if length is None else length)
    return bytes(whole) + struct.pack("<I", zlib.crc32(whole))


def accepted(blob: Blob, data: bytes | None = None) -> tuple[bytes, dict[str, Any]]:
    """Return a blob and its content for a reader; `data` : other bytes with the same content."""
    values = {key: plain(value) for key, value in asdict(blob).items() if value is not None}
    content = {"blob": values, "y": list(Y), "a": applied(blob, 0.0), "counts": list(COUNTS), "w": rates(blob)}
    return data or blob.encode(), content | (at_temperatures(blob) if any(blob.b_a_slope) else {})


def at_temperatures(blob: Blob) -> dict[str, Any]:
    """Return Y calibrated by b_a(T)."""
    low, high = blob.temperature_range_c
    away = [min(max(T, low), high) - blob.temperature_c for T in TEMPERATURES_C]
    return {"at_c": TEMPERATURES_C, "a_at": [applied(blob, each) for each in away]}


def applied(blob: Blob, away_c: float) -> list[float]:
    """Return inv(D) (Y - b_a(T) + applied_b_a) by Cramer's rule in fractions: the same on every machine."""
    D = [[Fraction(value) for value in blob.D[at : at + 3]] for at in (0, 3, 6)]
    terms = zip(Y, blob.b_a, blob.b_a_slope, blob.applied_b_a, strict=True)
    y = [Fraction(y) - Fraction(b) - Fraction(s) * Fraction(away_c) + Fraction(h) for y, b, s, h in terms]
    replaced = [[[y[i] if j == k else D[i][j] for j in range(3)] for i in range(3)] for k in range(3)]
    return [float(determinant(M) / determinant(D)) for M in replaced]


def rates(blob: Blob) -> list[float]:
    """Return K (y_omega - b_omega) of COUNTS at the blob's range (default 500 deg/s), also rounded only once."""
    unit = Fraction(math.pi) / 180 * Fraction(blob.gyro_range_dps or 500.0) / Fraction(blob.gyro_counts or GYRO_COUNTS)
    bias = [0.0 if math.isnan(value) else value for value in blob.b_omega]
    y = [count * unit - Fraction(value) for count, value in zip(COUNTS, bias, strict=True)]
    return [float(sum(Fraction(k) * v for k, v in zip(blob.K[at : at + 3], y, strict=True))) for at in (0, 3, 6)]


def determinant(M: list[list[Fraction]]) -> Fraction:
    """Return the determinant of a matrix of 3 by 3."""
    (a, b, c), (d, e, f), (g, h, i) = M
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


def plain(value: Any) -> Any:
    """Return a value in JSON's own types; NaN becomes null."""
    if isinstance(value, tuple):
        return [plain(item) for item in value]
    return None if isinstance(value, float) and math.isnan(value) else value


def with_byte(data: bytes, at: int, value: int) -> bytes:
    """Return `data` with one byte changed."""
    return data[:at] + bytes([value]) + data[at + 1 :]


def vectors() -> dict[str, tuple[bytes, dict[str, Any]]]:
    """Return by name the bytes and the content of the .json."""
    good = MEASURED.encode()
    body = good[:-4]
    nan, minus = struct.pack("<f", math.nan), struct.pack("<f", -4.0)
    singular = struct.pack("<9f", 1, 2, 3, 2, 4, 6, 0, 0, 1)
    return {
        "measured": accepted(MEASURED),
        "unknown": accepted(UNKNOWN),
        "applied": accepted(APPLIED),
        "sloped": accepted(SLOPED),
        "counted": accepted(COUNTED),
        "counted_otherwise": accepted(COUNTED_OTHERWISE),
        "appended": accepted(COUNTED, sealed(with_byte(COUNTED.encode()[:-4], 5, 3) + struct.pack("<2f", 1.5, -2.5))),
        "slope_cut": accepted(MEASURED, sealed(with_byte(body, 5, 1) + struct.pack("<2f", 1.5, -2.5))),
        "slope_not_finite": accepted(
            MEASURED, sealed(with_byte(body, 5, 1) + struct.pack("<5f", 1, math.nan, 1, 0, 50))
        ),
        "bad_magic": (sealed(b"MPUX" + body[4:]), {"rejected": "another magic"}),
        "bad_major": (sealed(with_byte(body, 4, 2)), {"rejected": "a major version that is not known"}),
        "bad_length": (sealed(body, length=len(good) + 1), {"rejected": "length is not the number of bytes"}),
        "bad_crc": (with_byte(good, 60, good[60] ^ 1), {"rejected": "the CRC-32 does not match"}),
        "cut": (good[:-1], {"rejected": "the last byte is missing"}),
        "not_finite": (sealed(body[:60] + nan + body[64:]), {"rejected": "D holds NaN"}),
        "singular": (sealed(body[:60] + singular + body[96:]), {"rejected": "D has no inverse"}),
        "range_not_finite": (sealed(body[:52] + nan + body[56:]), {"rejected": "accel_range_g is NaN"}),
        "range_negative": (sealed(body[:52] + minus + body[56:]), {"rejected": "accel_range_g is -4"}),
        "no_counts": (
            sealed(COUNTED.encode()[:-8] + bytes(4)),
            {"rejected": "gyro_counts is 0"},
        ),
    }


# The messages of the document's example, in its order, and one of each other kind: (seq, message).

FIFO_FRAME = bytes.fromhex("000c ffde 2000 f830 0038 ffb2 005a")
EXAMPLE: dict[str, tuple[int, wire.Message]] = {
    "hello": (0, wire.Hello()),
    "hello_reply": (
        0,
        wire.HelloReply(0, 0x0000F1A2, wire.MAGIC, 1, 0, 0x68, 3, 4, 256, b"mpucal-avr 1"),
    ),
    "read": (1, wire.Read(0x75, 1)),
    "read_reply": (1, wire.ReadReply(0, 0x0000F6B4, b"\x68")),
    "write": (2, wire.Write(0x23, b"\xf8")),
    "write_reply": (2, wire.WriteReply(0, 0x0000FBC8)),
    "stream": (3, wire.Stream(14, 2)),
    "stream_reply": (3, wire.StreamReply(0, 0x000100DC)),
    "frames": (3, wire.Frames(0, 0x00012900, 0, 0, 0, FIFO_FRAME * 2)),
    "frames_overflow": (3, wire.Frames(7, 0x00014E20, 2, 1, 0, b"")),
    "blob_state": (4, wire.BlobState()),
    "blob_state_none": (4, wire.BlobStateReply(8, 0x00015F00, 0, 0, 0)),
}
OTHERS: dict[str, tuple[int, wire.Message]] = {
    "burst": (254, wire.Burst(0x74, 70)),
    "burst_reply_first": (254, wire.BurstReply(0, 0xFFFFFF00, 0, FIFO_FRAME * 4)),
    "burst_reply_last": (254, wire.BurstReply(0, 0x00000010, 56, FIFO_FRAME)),
    "stream_stop": (255, wire.Stream(0, 0)),
    "leave": (12, wire.Leave()),
    "leave_reply": (12, wire.LeaveReply(0, 70700)),
    "blob_state_reply": (5, wire.BlobStateReply(0, 70000, 3, 188, 0x5D9B9255)),
    "blob_read": (6, wire.BlobRead(168, 20)),
    "blob_read_reply": (6, wire.BlobReadReply(0, 70100, MEASURED.encode()[168:])),
    "blob_begin": (7, wire.BlobBegin(188)),
    "blob_begin_reply": (7, wire.BlobBeginReply(0, 70200)),
    "blob_data": (8, wire.BlobData(0, MEASURED.encode()[:32])),
    "blob_data_reply": (8, wire.BlobDataReply(0, 70300)),
    "blob_commit": (9, wire.BlobCommit(188, 0x5D9B9255)),
    "blob_commit_reply": (9, wire.BlobCommitReply(0, 70400, 4)),
    "blob_erase": (10, wire.BlobErase()),
    "blob_erase_reply": (10, wire.BlobEraseReply(0, 70500)),
    "failed_early": (11, wire.Reply(1, 70600)),
}


BYTES = ("data", "frames")


def one_message(seq: int, message: wire.Message, kind: int | None = None) -> tuple[bytes, dict[str, Any]]:
    """Return the line's bytes of a message, and its content."""
    frame = Frame(message.TYPE if kind is None else kind, seq, message.payload())
    values = {
        key: value.rstrip(b"\0").decode() if key in ("magic", "name") else value.hex() if key in BYTES else value
        for key, value in vars(message).items()
    }
    return frame.encode(), {"frames": [plain_frame(frame)], "message": type(message).__name__, "values": values}


def plain_frame(frame: Frame) -> dict[str, Any]:
    """Return a frame in JSON's own types."""
    return {"type": frame.type, "seq": frame.seq, "payload": frame.payload.hex()}


def several(data: bytes, *frames: Frame, rejected: str = "") -> tuple[bytes, dict[str, Any]]:
    """Return bytes in which a receiver must find `frames` and nothing else."""
    why = {"rejected": rejected} if rejected else {}
    return data, {"frames": [plain_frame(frame) for frame in frames], **why}


def lines() -> dict[str, tuple[bytes, dict[str, Any]]]:
    """Return by name the bytes on the line and the content of the .json."""
    kinds = {"failed_early": wire.BlobStateReply.TYPE}
    made = {name: one_message(seq, message, kinds.get(name)) for name, (seq, message) in {**EXAMPLE, **OTHERS}.items()}
    read = Frame(2, 1, bytes([0x75, 1]))
    zeros, ones, longest = Frame(0, 0, bytes(66)), Frame(0xFF, 0xFF, b"\xff" * 66), Frame(0x7E, 0x55, bytes(range(66)))
    encoded = read.encode()
    damaged = encoded[:1] + bytes([encoded[1] ^ 0x40]) + encoded[2:]
    return {
        **made,
        "zeros": several(zeros.encode(), zeros),
        "ones": several(ones.encode(), ones),
        "longest": several(longest.encode(), longest),
        "no_payload": several(Frame(0x10, 9).encode(), Frame(0x10, 9)),
        "idle": several(b"\0\0" + encoded + b"\0\0\0" + encoded, read, read),
        "begun_within": several(
            longest.encode()[30:] + encoded, read, rejected="the first frame's beginning is missing"
        ),
        "text": several(b"Initializing I2C devices...\r\n\0" + encoded, read, rejected="text is no frame"),
        "bad_crc": several(damaged + encoded, read, rejected="the CRC-16 does not match"),
        "cut": several(encoded[:-3] + b"\0" + encoded, read, rejected="two bytes are missing"),
        "beyond_the_end": several(b"\x09" + encoded[1:], rejected="a COBS length points beyond the end"),
        "too_short": several(stuff(b"\x01\x00\xff") + b"\0" + encoded, read, rejected="three bytes"),
        "too_long": several(b"\x01" * 72 + b"\0" + encoded, read, rejected="72 bytes without a zero"),
        "far_too_long": several(b"\x55" * 300 + b"\0" + encoded, read, rejected="300 bytes without a zero"),
        "unfinished": several(encoded[:-1], rejected="no delimiter yet"),
    }


CHUNKS = [
    f"13 {at // 32} {wire.BlobData(at, MEASURED.encode()[at : at + 32]).payload().hex()}" for at in range(0, 188, 32)
]
DATA = [f"{chunk} > OK" for chunk in CHUNKS]
COMMIT = f"14 9 {wire.BlobCommit(188, 0x5D9B9255).payload().hex()}"
MACROS = {
    "READ": "02 2 7202 > OK 01f8",
    "HELLO": wire.Hello().payload().hex(),
    "BEGIN": f"12 8 {wire.BlobBegin(188).payload().hex()} > OK",
    "DATA": "\n".join(DATA),
    "DATA0": DATA[0],
    "REST": "\n".join(DATA[1:]),
    "CHUNK1": CHUNKS[1],
    "COMMIT": COMMIT,
    "COMMITTED": f"{COMMIT} > OK {struct.pack('<I', 1).hex()}",
}


def exchanged(text: str) -> tuple[Frame, Frame | None]:
    """Return the request and the reply of a line of an exchange; the reply's t_us is 0."""
    asked, _, answered = text.partition(" > ")
    kind, seq, *payload = asked.split()
    request = Frame(int(kind, 16), int(seq), bytes.fromhex("".join(payload)))
    if not answered:
        return request, None
    status, *content = answered.split()
    reply = bytes([wire.Status[status]]) + bytes(4) + bytes.fromhex("".join(content))
    return request, Frame(request.type | wire.REPLY_BIT, request.seq, reply)


def exchange(rule: str, needs: list[str], lines: list[str]) -> dict[str, Any]:
    """Return an exchange's JSON: requests as bytes on the line, and replies as frames; a list where several are due."""
    said: list[dict[str, Any]] = []
    for line in lines:
        pairs = [exchanged(text) for text in line.split(" & ")]
        answers = [plain_frame(reply) for _, reply in pairs if reply is not None]
        host = b"".join(request.encode() for request, _ in pairs)
        said.append({"host": host.hex(), "bridge": answers if len(pairs) > 1 else next(iter(answers), None)})
    return {"rule": rule, "needs": needs, "steps": said}


def exchanges() -> dict[str, dict[str, Any]]:
    """Return the exchanges' JSON by name."""
    rows = tomllib.loads(Path(__file__).with_name("exchanges.toml").read_text(encoding="utf-8"))
    return {
        name: exchange(row["rule"], row["needs"], "\n".join(row["lines"]).format_map(MACROS).splitlines())
        for name, row in rows.items()
    }


def clock(bits: int) -> dict[str, Any]:
    """Return the JSON of a clock of `bits` bits: its readings, and `t_us`, which wraps in between."""
    # steps a little shorter than its period
    passed_us = [i * (2**bits - 3) for i in range(6)]
    return {
        "rule": "a clock that is narrower than 32 bits is extended to them",
        "bits": bits,
        "shows": [us % 2**bits for us in passed_us],
        "t_us": [(2**32 - 2 ** (bits + 1) + us) % 2**32 for us in passed_us],
    }


def slots(*generations: int) -> bytes:
    """Return both slots of the storage, each with MEASURED."""
    seals = [struct.pack("<II", generation, generation ^ 0xFFFFFFFF) for generation in generations]
    return b"".join(seal + MEASURED.encode().ljust(256, b"\0") for seal in seals)


# MicroPython's clock has 30 bits, other boards have a timer of 24
CLOCK_BITS = (24, 30)
SLOTS = {"wrapped": (2**32 - 1, 1), "before_the_wrap": (2**32 - 2, 2**32 - 1), "half_way": (2**31, 1)}


def write(folder: Path) -> None:
    """Write all vectors into the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for prefix, made in (("blob", vectors()), ("line", lines())):
        for name, (data, content) in made.items():
            (folder / f"{prefix}_{name}.bin").write_bytes(data)
            (folder / f"{prefix}_{name}.json").write_text(json.dumps(content, indent=2) + "\n")
    for name, content in exchanges().items():
        (folder / f"exchange_{name}.json").write_text(json.dumps(content, indent=2) + "\n")
    for bits in CLOCK_BITS:
        (folder / f"clock_{bits}_bits.json").write_text(json.dumps(clock(bits), indent=2) + "\n")
    for name, generations in SLOTS.items():
        (folder / f"slots_{name}.bin").write_bytes(slots(*generations))
        late = 0 if (generations[1] - generations[0]) % 2**32 >= 2**31 else 1
        after = generations[late] % (2**32 - 1) + 1
        content = {"stored": late, "generation": generations[late], "generation_of_the_next": after}
        (folder / f"slots_{name}.json").write_text(json.dumps(content, indent=2) + "\n")


def main(folder: Path = FOLDER) -> None:
    """Write them into FOLDER and the exchanges into the package, too; or all into the folder that is named."""
    write(folder)
    if folder == FOLDER:
        EXCHANGES_FILE.write_text(json.dumps(exchanges(), indent=1) + "\n")
