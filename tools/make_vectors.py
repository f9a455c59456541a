"""Write the golden vectors of firmware_protocol.md: python tools/make_vectors.py [FOLDER].

Each blob_*.bin lies beside a blob_*.json that says what a reader must find in it, or why it must refuse it.
"""

from __future__ import annotations

import json
import math
import struct
import sys
import zlib
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from mpucal.wire.blob import Blob

FOLDER = Path(__file__).parent.parent / "fixtures" / "vectors"

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
Y = (0.5, -1.25, 10.5)


def sealed(body: bytes, length: int | None = None) -> bytes:
    """`body` with its length and CRC-32 made right; `length` writes another one."""
    body = bytearray(body)
    struct.pack_into("<H", body, 6, len(body) + 4 if length is None else length)
    return bytes(body) + struct.pack("<I", zlib.crc32(body))


def accepted(blob: Blob, data: bytes | None = None) -> tuple[bytes, dict[str, Any]]:
    """A blob and what a reader finds in it; `data` are other bytes that mean the same."""
    values = {key: plain(value) for key, value in asdict(blob).items()}
    D = np.array(blob.D).reshape(3, 3)
    a = np.linalg.solve(D, np.array(Y) - blob.b_a + blob.applied_b_a)
    return data or blob.encode(), {"blob": values, "y": list(Y), "a": a.tolist()}


def plain(value: Any) -> Any:
    """JSON's own types; NaN becomes null."""
    if isinstance(value, tuple):
        return [plain(item) for item in value]
    return None if isinstance(value, float) and math.isnan(value) else value


def with_byte(data: bytes, at: int, value: int) -> bytes:
    """`data` with one byte changed."""
    return data[:at] + bytes([value]) + data[at + 1 :]


def vectors() -> dict[str, tuple[bytes, dict[str, Any]]]:
    """Name -> (bytes, content of the .json)."""
    good = MEASURED.encode()
    body = good[:-4]
    nan = struct.pack("<f", math.nan)
    return {
        "measured": accepted(MEASURED),
        "unknown": accepted(UNKNOWN),
        "applied": accepted(APPLIED),
        "appended": accepted(MEASURED, sealed(with_byte(body, 5, 1) + struct.pack("<2f", 1.5, -2.5))),
        "bad_magic": (sealed(b"MPUX" + body[4:]), {"rejected": "another magic"}),
        "bad_major": (sealed(with_byte(body, 4, 2)), {"rejected": "a major version that is not known"}),
        "bad_length": (sealed(body, length=len(good) + 1), {"rejected": "length is not the number of bytes"}),
        "bad_crc": (with_byte(good, 60, good[60] ^ 1), {"rejected": "the CRC-32 does not match"}),
        "cut": (good[:-1], {"rejected": "the last byte is missing"}),
        "not_finite": (sealed(body[:60] + nan + body[64:]), {"rejected": "D holds NaN"}),
    }


def write(folder: Path) -> None:
    """Write all vectors into the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, (data, content) in vectors().items():
        (folder / f"blob_{name}.bin").write_bytes(data)
        (folder / f"blob_{name}.json").write_text(json.dumps(content, indent=2) + "\n")


if __name__ == "__main__":
    write(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)
