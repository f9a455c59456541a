import json
import math
import re
import struct
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from mpucal.result.blob import (
    FORMATS,
    FORMULA,
    LENGTHS,
    Blob,
    BlobError,
)
from mpucal.result.calibration import Calibration
from tools.make import vectors
from tools.make.vectors import sealed

VECTORS = vectors.FOLDER
PROTOCOL = (Path(__file__).parents[2] / "firmware_protocol.md").read_text().split("\n## The config blob\n")[1]


def plain(blob):
    """Values that compare equal where NaN stands for NaN."""
    return repr(asdict(blob))


@pytest.fixture
def blob():
    return Blob.decode((VECTORS / "blob_measured.bin").read_bytes())


def test_no_damaged_byte_and_no_shorter_blob_is_accepted(blob):
    good = blob.encode()
    for at in range(len(good)):
        # `reserved` is under the checksum too
        for damaged in (good[:at], good[:at] + bytes([good[at] ^ 0x10]) + good[at + 1 :]):
            with pytest.raises(BlobError):
                Blob.decode(damaged)


@pytest.mark.parametrize(
    ("name", "at", "format", "bad"),
    [
        ("b_a", 96, "<f", math.nan),
        ("applied_b_a", 124, "<f", math.inf),
        ("gyro_range_dps", 56, "<f", -4.0),
        ("gyro_range_dps", 56, "<f", math.inf),
        ("gyro_counts", 204, "<f", math.nan),
        ("created", 112, "<Q", 2**64 - 1),
    ],
)
def test_unusable_numbers_are_refused_on_both_sides(blob, name, at, format, bad):
    counted = replace(blob, gyro_counts=32750.0)
    if name != "created":
        value = getattr(blob, name)
        with pytest.raises(BlobError, match=f"{name} (holds|is)"):
            replace(blob, **{name: (bad, *value[1:]) if isinstance(value, tuple) else bad}).encode()
    body = bytearray(counted.encode()[:-4])
    struct.pack_into(format, body, at, bad)
    with pytest.raises(BlobError, match=f"{name} (holds|is)|out of range"):
        Blob.decode(sealed(body))


@pytest.mark.parametrize(
    "change",
    [
        pytest.param({"who_am_i": 256}, id="who_am_i over a byte"),
        pytest.param({"gravity": 1e39}, id="beyond float32"),
        pytest.param({"D": (1.0,) * 8}, id="D too short"),
        pytest.param({"created": "yesterday"}, id="no time"),
        pytest.param({"created": "1969-12-31T23:59:59+00:00"}, id="before 1970"),
    ],
)
def test_values_that_do_not_fit_are_refused(blob, change):
    with pytest.raises(BlobError):
        replace(blob, **change).encode()


def test_created_is_kept_in_whole_seconds_of_utc(blob):
    for created in ("2024-05-17T09:30:00", "2024-05-17T11:30:00.987+02:00"):
        assert Blob.decode(replace(blob, created=created).encode()).created == "2024-05-17T09:30:00+00:00"


def from_json(value):
    if isinstance(value, list):
        return tuple(map(from_json, value))
    return math.nan if value is None else value


@pytest.mark.parametrize("name", sorted(path.stem for path in VECTORS.glob("blob_*.bin")))
def test_golden_vector(name):
    data = (VECTORS / f"{name}.bin").read_bytes()
    expected = json.loads((VECTORS / f"{name}.json").read_text())
    if "rejected" in expected:
        with pytest.raises(BlobError):
            Blob.decode(data)
        return
    blob = Blob.decode(data)
    values = {key: from_json(value) for key, value in expected["blob"].items()}
    assert plain(blob) == plain(Blob(**values))
    # fields that a newer minor version appended, or that cannot be used, are skipped
    assert name in ("blob_appended", "blob_slope_cut", "blob_slope_not_finite") or blob.encode() == data
    assert plain(Blob.decode(blob.encode())) == plain(blob)
    a = np.linalg.inv(np.reshape(blob.D, (3, 3))) @ (np.array(expected["y"]) - blob.b_a + blob.applied_b_a)
    np.testing.assert_allclose(a, expected["a"], rtol=1e-12)
    unit = np.radians(blob.gyro_range_dps or 500.0) / 32750
    _, w = Calibration.from_blob(blob).apply([0, 0, 0], np.array(expected["counts"]) * unit)
    np.testing.assert_allclose(w, expected["w"], rtol=1e-12)


def test_the_tool_writes_the_vectors_that_are_there(tmp_path):
    vectors.write(tmp_path)
    made = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    stored = {path.name: path.read_bytes() for path in VECTORS.iterdir()}
    assert made.keys() == stored.keys()
    assert [name for name in stored if made[name] != stored[name]] == []


def test_the_documents_table_is_the_codecs_format():
    codes = {"char": "{}s", "u8": "B", "u16": "H", "u32": "I", "u64": "Q", "f32": "f"}
    rows = re.findall(r"^\| (\d+)(?:-(\d+))? \| (\w+) \| (\w+)(?:\[(\d+)\])? \|", PROTOCOL, re.M)
    expected, at = "<", 0
    for first, last, name, kind, count in rows:
        assert int(first) == at, name
        code = f"{count}s" if kind == "char" else f"{count}{codes[kind]}"
        code = f"{count}x" if name == "reserved" else code
        assert struct.calcsize("<" + code) == int(last or first) - int(first) + 1, name
        expected, at = f"{expected} {code}", int(last or first) + 1
    assert expected.replace("< ", "<") == FORMATS[2].format
    assert at + 4 == LENGTHS[2]


def test_the_documents_example_is_the_blob_of_its_numbers(blob):
    lines = re.findall(r"^    ([0-9a-f]{4})  ((?:[0-9a-f]{2} ?)+)$", PROTOCOL, re.M)
    assert [int(offset, 16) for offset, _ in lines] == list(range(0, LENGTHS[0], 16))
    assert bytes.fromhex(" ".join(row for _, row in lines)) == blob.encode()
    for number in (*blob.D, *blob.b_a, blob.gravity, blob.temperature_c):
        assert f"{number:.9g}" in PROTOCOL
    assert FORMULA in PROTOCOL
    a = [f"{value:.5f}" for value in json.loads((VECTORS / "blob_measured.json").read_text())["a"]]
    assert ", ".join(a) in PROTOCOL
