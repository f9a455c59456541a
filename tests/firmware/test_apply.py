"""Header mpucal_apply.h against the Python codec and NumPy: golden vectors, random blobs, float32 rounding."""

import ctypes
import json
import os
import struct
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mpucal.result.blob import LENGTHS, MAX_LENGTH, Blob, BlobError

ROOT = Path(__file__).parents[2]
VECTORS = ROOT / "fixtures" / "vectors"
MEASURED = Blob.decode((VECTORS / "blob_measured.bin").read_bytes())
WANTED = {path: json.loads(path.with_suffix(".json").read_text()) for path in sorted(VECTORS.glob("blob_*.bin"))}

OK, NO_BLOB, OTHER_MAJOR, BAD_LENGTH, BAD_CRC, NOT_FINITE, NOT_INVERTIBLE, OTHER_CHIP, OTHER_RANGE, NO_ROOM = range(10)
EPS = np.finfo(np.float32).eps
STANDARD_GRAVITY_MPS2 = 9.80665
MPS2_PER_COUNT = 4 * STANDARD_GRAVITY_MPS2 / 32768
BLOBS = 10_000
# the calendar ends in the year 9999
LAST_SECOND = 253_402_300_799


@pytest.fixture(scope="module")
def call(core):
    """Calls a function of host.c for a blob and counts: (status, what it computed)."""

    def run(name, blob, *how, counts=(0, 0, 0), made=np.float32):
        counts = np.ascontiguousarray(counts, np.int16)
        out = np.full(counts.shape, -1, made)
        # of exactly this size, so that a sanitizer sees a byte too many
        memory = (ctypes.c_uint8 * len(blob)).from_buffer_copy(blob)
        pointers = [array.ctypes.data_as(ctypes.c_void_p) for array in (counts, out)]
        function = getattr(core, f"host_{name}")
        function.restype = ctypes.c_uint8
        return function(memory, ctypes.c_uint32(len(blob)), *how, *pointers), out

    return run


@pytest.fixture(scope="module")
def load(call):
    """Loads a blob for a chip and a range; returns the status."""
    return lambda blob, who=0, range_g=0.0: call("apply", blob, ctypes.c_uint8(who), ctypes.c_float(range_g))[0]


@pytest.mark.parametrize("path", WANTED, ids=lambda path: path.stem)
def test_agrees_with_every_golden_vector(path, call, load):
    """Acceleration at each temperature, and angular rate."""
    wanted, data = WANTED[path], path.read_bytes()
    if "rejected" in wanted:
        assert load(data, range_g=4.0) in (*range(NO_BLOB, NOT_INVERTIBLE + 1), OTHER_RANGE)
        return
    blob = Blob.decode(data)
    counts = np.rint(np.array(wanted["y"]) / MPS2_PER_COUNT)
    rounded = np.linalg.solve(np.array(blob.D).reshape(3, 3), counts * MPS2_PER_COUNT - wanted["y"])
    for temperature_c, a in zip(wanted.get("at_c", [85.0]), wanted.get("a_at", [wanted["a"]]), strict=True):
        status, found = call("apply_at", data, ctypes.c_float(temperature_c), counts=counts)
        assert (status, found) == (OK, pytest.approx(np.array(a) + rounded, abs=1e-5))
    status, w = call("apply_gyro", data, ctypes.c_float(500.0), counts=wanted["counts"])
    assert (status, w) == (OK, pytest.approx(np.array(wanted["w"]), abs=1e-5))


def test_bias_at_an_unknown_temperature_is_that_of_the_blob(call):
    data, counts = (VECTORS / "blob_sloped.bin").read_bytes(), (100, -200, 8000)
    either = [
        call("apply_at", data, ctypes.c_float(celsius), counts=counts)[1].tolist()
        for celsius in (np.nan, Blob.decode(data).temperature_c)
    ]
    assert either[0] == either[1]


@pytest.mark.parametrize(
    ("measured", "used", "status"),
    [
        ((0x68, 4.0), (0x68, 4.0), OK),
        ((0x68, 4.0), (0, 0.0), OK),
        ((0, 0.0), (0x68, 4.0), OK),
        ((0x68, 4.0), (0x70, 4.0), OTHER_CHIP),
        ((0x68, 4.0), (0x68, 2.0), OTHER_RANGE),
        ((0x68, 0.0), (0x68, 0.0), OTHER_RANGE),
    ],
)
def test_says_where_a_blob_does_not_belong(measured, used, status, load):
    assert load(replace(MEASURED, who_am_i=measured[0], accel_range_g=measured[1]).encode(), *used) == status


def test_a_gyroscope_at_another_range_is_refused(call):
    assert call("apply_gyro", MEASURED.encode(), ctypes.c_float(250.0))[0] == OTHER_RANGE


@pytest.mark.parametrize(
    "D",
    [np.zeros(9), np.ones(9), np.eye(3).ravel() * 1e-20, np.eye(3).ravel() * 1e20, [1, 2, 3, 2, 4, 6, 0, 0, 1]],
    ids=["zero", "ones", "tiny", "huge", "two rows alike"],
)
def test_a_matrix_that_cannot_be_inverted_is_refused(D, load):
    body = bytearray(MEASURED.encode()[:-4])
    body[60:96] = np.float32(D).tobytes()
    blob = bytes(body) + struct.pack("<I", zlib.crc32(body))
    with pytest.raises(BlobError, match="no inverse"):
        Blob.decode(blob)
    assert load(blob) == NOT_INVERTIBLE


def random_blobs(rng, count):
    """(count, 256) bytes and (count,) sizes: blobs of all values, some appended to, some spoilt, some not finite."""
    data = rng.integers(0, 256, (count, MAX_LENGTH), np.uint8)
    data[:, :48] = np.frombuffer(MEASURED.encode()[:48], np.uint8)
    data[:, 52:56] = rng.choice(np.float32([0, 2, 4, 8, 16, np.nan, -4]), (count, 1)).view(np.uint8)
    # mostly unknown: Python decodes dates slowly
    data[:, 112:120] = (rng.integers(0, LAST_SECOND, (count, 1)) * (rng.random((count, 1)) < 0.1)).view(np.uint8)
    for at, numbers in ((60, 9), (96, 3), (124, 3)):
        values = rng.normal(size=(count, numbers)) * 10.0 ** rng.integers(-3, 3, (count, 1))
        if at == 60:
            values = values * 0.1 + np.eye(3).ravel()
        data[:, at : at + 4 * numbers] = values.astype(np.float32).view(np.uint8)
    wild = rng.random(count) < 0.1
    data[wild, 60:108] = rng.integers(0, 256, (wild.sum(), 48), np.uint8)
    sizes = np.where(rng.random(count) < 0.7, LENGTHS[0], rng.integers(LENGTHS[0], MAX_LENGTH + 1, count)).astype(
        np.uint16
    )
    data[:, 6:8] = sizes[:, None].view(np.uint8)
    for row, size in zip(data, sizes, strict=True):
        row[size - 4 : size] = np.frombuffer(struct.pack("<I", zlib.crc32(row[: size - 4])), np.uint8)
    spoilt = np.flatnonzero(rng.random(count) < 0.2)
    # half of the damage is in the header
    at = np.where(
        rng.random(len(spoilt)) < 0.5, rng.integers(0, 8, len(spoilt)), rng.integers(0, LENGTHS[0], len(spoilt))
    )
    data[spoilt, at] ^= rng.integers(1, 256, len(spoilt)).astype(np.uint8)
    cut = rng.random(count) < 0.02
    sizes[cut] = rng.integers(0, sizes[cut])
    return data, sizes


def read_by_c(core, data, sizes, counts):
    count = len(sizes)
    checked, loaded = np.zeros(count, np.uint8), np.zeros(count, np.uint8)
    fields, a = np.zeros((count, 16), np.float32), np.full((count, 3), np.nan, np.float32)
    arrays = (data, sizes, counts, checked, loaded, fields, a)
    data_p, sizes_p, *others = (array.ctypes.data_as(ctypes.c_void_p) for array in arrays)
    core.host_read_blobs(data_p, ctypes.c_uint32(data.shape[1]), sizes_p, ctypes.c_uint32(count), *others)
    return checked, loaded, fields, a


def read_by_python(data, sizes):
    """(n,) accepted, and of those (m, 16) fields as float32: D, b_a, applied_b_a, accel_range_g."""
    accepted, fields = np.zeros(len(sizes), bool), []
    for i, (row, size) in enumerate(zip(data, sizes.tolist(), strict=True)):
        try:
            blob = Blob.decode(row[:size].tobytes())
        except BlobError:
            continue
        accepted[i] = True
        fields.append((*blob.D, *blob.b_a, *blob.applied_b_a, blob.accel_range_g))
    return accepted, np.array(fields, np.float32)


@pytest.mark.skipif("MPUCAL_SANITIZE" in os.environ, reason="so many of them take a minute under the sanitizers")
def test_reads_random_blobs_as_python_does(core):
    rng = np.random.default_rng(6)
    data, sizes = random_blobs(rng, BLOBS)
    counts = rng.integers(-32768, 32768, (BLOBS, 3)).astype(np.int16)
    checked, loaded, fields, a = read_by_c(core, data, sizes, counts)
    accepted, wanted = read_by_python(data, sizes)
    assert np.array_equal(checked == OK, accepted)
    assert fields[accepted].tobytes() == wanted.tobytes()
    computed = check_computed(loaded[accepted] == OK, wanted, counts[accepted], a[accepted])
    # each outcome occurs in a tenth of the blobs or more
    assert min(accepted.sum(), (~accepted).sum(), computed) > BLOBS / 10


def check_computed(usable, fields, counts, a):
    """Check the applied ones to float32 rounding, and return their number."""
    D, b, applied, range_g = np.split(fields.astype(float), [9, 12, 15], axis=1)
    well = usable & (np.abs(D).max(axis=1) < 1e3) & (np.abs(np.linalg.det(D.reshape(-1, 3, 3))) > 1e-3)
    D, b, applied, range_g = D[well].reshape(-1, 3, 3), b[well], applied[well], range_g[well]
    y = counts[well] * (STANDARD_GRAVITY_MPS2 * range_g / 32768)
    inverse = np.linalg.inv(D)
    exact = np.einsum("nij,nj->ni", inverse, y - b + applied)
    size = np.einsum("nij,nj->ni", np.abs(inverse), np.abs(y) + np.abs(b) + np.abs(applied))
    bound = 16 * EPS * np.linalg.cond(D)[:, None] ** 2 * size
    assert (np.abs(a[well] - exact) <= bound).all()
    return well.sum()


def test_a_blob_cut_anywhere_is_refused_and_nothing_read_behind_it(load):
    whole = bytearray(MEASURED.encode()[:-4]) + bytes(MAX_LENGTH - LENGTHS[0])
    struct.pack_into("<H", whole, 6, MAX_LENGTH)
    whole += struct.pack("<I", zlib.crc32(whole))
    for size in range(MAX_LENGTH):
        assert load(bytes(whole[:size])) in (NO_BLOB, BAD_LENGTH), size


ENDS = np.array(np.meshgrid(*[[-32768, -32767, -1, 0, 1, 32767]] * 3)).reshape(3, -1).T


def test_fixed_point_is_within_a_count_over_the_whole_range(call):
    for seed in range(20):
        rng = np.random.default_rng(seed)
        D = np.eye(3) * rng.uniform(0.7, 1.4, 3) + rng.uniform(-0.15, 0.15, (3, 3))
        b_a = rng.uniform(-5, 5, 3)
        counts = np.vstack([ENDS, rng.integers(-32768, 32768, (5000, 3))])
        blob = replace(MEASURED, D=tuple(D.ravel()), b_a=tuple(b_a)).encode()
        status, corrected = call("apply_fixed", blob, ctypes.c_uint32(len(counts)), counts=counts, made=np.int32)
        assert status == OK, seed
        assert np.abs(corrected - np.linalg.solve(D, (counts - b_a / MPS2_PER_COUNT).T).T).max() < 0.55, seed


@pytest.mark.parametrize("changes", [{"D": (0.5, 0, 0, 0, 1, 0, 0, 0, 1)}, {"b_a": (5000.0, 0, 0)}], ids=["D", "b_a"])
def test_values_too_large_for_fixed_point_are_refused(changes, call):
    assert call("apply_fixed", replace(MEASURED, **changes).encode(), ctypes.c_uint32(1), made=np.int32)[0] == NO_ROOM
