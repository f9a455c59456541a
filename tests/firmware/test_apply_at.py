"""mpucal_apply_at against the golden vectors: b_a(T), where a blob has one, between its ends and beyond them."""

import ctypes
import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mpucal.result.blob import Blob

ROOT = Path(__file__).parents[2]
VECTORS = ROOT / "fixtures" / "vectors"
HOST = """
#include "mpucal_apply.h"
unsigned char host_apply_at(const void *blob, unsigned size, const int16_t *counts, float temperature_c, float *a) {
    struct mpucal sensor;
    struct mpucal_drift drift;
    struct mpucal_source source = {mpucal_read_memory, blob, size};
    enum mpucal_status status = mpucal_load_from(&sensor, &source, 0, 4.0f);
    if (status == MPUCAL_OK) status = mpucal_load_drift(&drift, &source);
    if (status == MPUCAL_OK) mpucal_apply_at(&sensor, &drift, counts, temperature_c, a);
    return (unsigned char)status;
}
unsigned char host_apply_gyro(const void *blob, unsigned size, float range_dps, const int16_t *counts, float *w) {
    struct mpucal_gyro gyro;
    struct mpucal_source source = {mpucal_read_memory, blob, size};
    enum mpucal_status status = mpucal_load_gyro(&gyro, &source, range_dps);
    if (status == MPUCAL_OK) mpucal_apply_gyro(&gyro, counts, w);
    return (unsigned char)status;
}
unsigned char host_apply_fixed(const void *blob, unsigned size, const int16_t *counts, unsigned n, int32_t *corrected) {
    struct mpucal sensor;
    struct mpucal_fixed fixed;
    enum mpucal_status status = mpucal_load(&sensor, blob, size, 0, 4.0f);
    if (status == MPUCAL_OK) status = mpucal_fix_accel(&fixed, &sensor, 4.0f);
    if (status == MPUCAL_OK) for (; n--; counts += 3, corrected += 3) mpucal_apply_fixed(&fixed, counts, corrected);
    return (unsigned char)status;
}
"""
ACCEPTED = [
    path for path in sorted(VECTORS.glob("blob_*.bin")) if "blob" in json.loads(path.with_suffix(".json").read_text())
]


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    if shutil.which("gcc") is None:
        pytest.skip("needs gcc")
    folder = tmp_path_factory.mktemp("apply_at")
    (folder / "host.c").write_text(HOST)
    flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror", "-shared", "-fPIC"]
    words = ["gcc", *flags, f"-I{ROOT / 'mpucal/firmware/src'}", "-o", "host.so", "host.c"]
    subprocess.run(words, cwd=folder, check=True)
    return ctypes.CDLL(str(folder / "host.so"))


@pytest.fixture(scope="module")
def apply_at(library):
    def call(data, counts, temperature_c):
        a = np.full(3, np.nan, np.float32)
        counts = np.asarray(counts, np.int16)
        status = library.host_apply_at(
            data,
            len(data),
            counts.ctypes.data_as(ctypes.c_void_p),
            ctypes.c_float(temperature_c),
            a.ctypes.data_as(ctypes.c_void_p),
        )
        assert status == 0
        return a

    return call


@pytest.mark.parametrize("path", ACCEPTED, ids=lambda path: path.stem)
def test_agrees_with_every_golden_vector(path, apply_at):
    wanted = json.loads(path.with_suffix(".json").read_text())
    data = path.read_bytes()
    blob = Blob.decode(data)
    mps2_per_count = 9.80665 * 4 / 32768
    counts = np.rint(np.array(wanted["y"]) / mps2_per_count)
    D = np.array(blob.D).reshape(3, 3)
    rounded = np.linalg.solve(D, counts * mps2_per_count - wanted["y"])
    temperatures = wanted.get("at_c", [-40.0, 25.0, 85.0])
    for temperature_c, a in zip(temperatures, wanted.get("a_at", [wanted["a"]] * 3), strict=True):
        assert apply_at(data, counts, temperature_c) == pytest.approx(np.array(a) + rounded, abs=1e-5)


def test_at_a_temperature_that_is_not_known_b_a_is_the_blobs(apply_at):
    path = VECTORS / "blob_sloped.bin"
    at_c = Blob.decode(path.read_bytes()).temperature_c
    counts = (100, -200, 8000)
    np.testing.assert_array_equal(
        apply_at(path.read_bytes(), counts, np.nan), apply_at(path.read_bytes(), counts, at_c)
    )


def _rate(library, data, range_dps, counts):
    w = np.full(3, np.nan, np.float32)
    counts = np.asarray(counts, np.int16)
    pointers = [array.ctypes.data_as(ctypes.c_void_p) for array in (counts, w)]
    return library.host_apply_gyro(data, len(data), ctypes.c_float(range_dps), *pointers), w


@pytest.mark.parametrize("path", ACCEPTED, ids=lambda path: path.stem)
def test_the_gyroscope_is_corrected_by_k_and_b_omega(path, library):
    wanted = json.loads(path.with_suffix(".json").read_text())
    status, w = _rate(library, path.read_bytes(), 500.0, wanted["counts"])
    assert status == 0
    np.testing.assert_allclose(w, wanted["w"], atol=1e-5)


def test_a_gyroscope_at_another_range_is_refused(library):
    assert _rate(library, (VECTORS / "blob_measured.bin").read_bytes(), 250.0, (1, 2, 3))[0] == 8


MEASURED = Blob.decode((VECTORS / "blob_measured.bin").read_bytes())
ENDS = np.array(np.meshgrid(*[[-32768, -32767, -1, 0, 1, 32767]] * 3)).reshape(3, -1).T


def _fixed(library, blob, counts):
    counts, data = np.ascontiguousarray(counts, np.int16), blob.encode()
    corrected = np.zeros(counts.shape, np.int32)
    pointers = [array.ctypes.data_as(ctypes.c_void_p) for array in (counts, corrected)]
    return library.host_apply_fixed(data, len(data), pointers[0], len(counts), pointers[1]), corrected


def test_fixed_point_is_within_a_count_over_the_whole_range(library):
    for seed in range(20):
        rng = np.random.default_rng(seed)
        D = np.eye(3) * rng.uniform(0.7, 1.4, 3) + rng.uniform(-0.15, 0.15, (3, 3))
        b_a = rng.uniform(-5, 5, 3)
        counts = np.vstack([ENDS, rng.integers(-32768, 32768, (20_000, 3))])
        status, corrected = _fixed(library, replace(MEASURED, D=tuple(D.ravel()), b_a=tuple(b_a)), counts)
        exact = np.linalg.solve(D, (counts - b_a * 32768 / (4 * 9.80665)).T).T
        assert status == 0, seed
        assert np.abs(corrected - exact).max() < 0.55, seed


@pytest.mark.parametrize("changes", [{"D": (0.5, 0, 0, 0, 1, 0, 0, 0, 1)}, {"b_a": (5000.0, 0, 0)}], ids=["D", "b_a"])
def test_what_has_no_room_in_fixed_point_is_refused(changes, library):
    assert _fixed(library, replace(MEASURED, **changes), [[1, 2, 3]])[0] == 9
