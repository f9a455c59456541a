"""Counts of a session's capture, at every range: each consumer makes of them what Python makes of the samples."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mpucal.chip import registers as reg
from mpucal.export.forms import form
from mpucal.files.capture import load_capture
from mpucal.result.calibration import Calibration

ROOT = Path(__file__).parents[2]
RANGES = tuple(zip(reg.ACCEL_RANGES_G, reg.GYRO_RANGES_DPS, strict=True))
# rounding of float32 at full scale: eight roundings of 16 g and of 2000 deg/s
ATOL_A, ATOL_W = 8 * 2**-24 * 160, 8 * 2**-24 * 40


@pytest.fixture(scope="module")
def words():
    """(n, 3) counts of the accelerometer and of the gyroscope, with the ends of their scale."""
    recording = load_capture(ROOT / "fixtures" / "sessions" / "mpu6050.mcap")
    a_code = reg.ACCEL_RANGES_G.index(recording.sensor.accel_range_g)
    w_code = reg.GYRO_RANGES_DPS.index(recording.sensor.gyro_range_dps)
    counts = np.hstack([recording.acc / reg.mps2_per_lsb(a_code), recording.gyr / reg.rad_s_per_lsb(w_code)])
    # the driver has made its samples of these counts
    np.testing.assert_allclose(counts, np.rint(counts), atol=1e-6)
    ends = np.tile([[32767, -32768, 32767]], 2)
    return np.vstack([np.rint(counts[:: len(counts) // 100]), ends, -1 - ends]).astype(int)


@pytest.fixture(params=range(4), ids=[f"{g} g, {dps} deg/s" for g, dps in RANGES])
def ranged(request, calibration, words):
    """A range's number, a calibration at it, and what that makes of the words: m/s^2, rad/s."""
    made = _at(calibration, request.param)
    return request.param, made, *_samples_applied(made, words, request.param)


def _at(calibration, code):
    g, dps = RANGES[code]
    return replace(calibration, sensor=replace(calibration.sensor, accel_range_g=float(g), gyro_range_dps=float(dps)))


def _samples_applied(calibration, words, code):
    # as the driver makes samples of a frame
    return calibration.apply(words[:, :3] * reg.mps2_per_lsb(code), words[:, 3:] * reg.rad_s_per_lsb(code))


@pytest.fixture(scope="module")
def in_c(tmp_path_factory, words, compiled):
    """Compiles the C header of each range and the blob of each into one program, once; gives what it prints of each."""
    folder, printed = tmp_path_factory.mktemp("counts"), {}

    def of(calibration, code):
        if not printed:
            program = _program(folder, [_at(calibration, each) for each in range(4)])
            run = compiled(folder, "main.cpp", program, "-std=c++11", "-Wno-unused")
            fed = "".join(" ".join(map(str, row)) + "\n" for row in words)
            printed["all"] = run(fed).reshape(len(words), 4, 18)
        return np.split(printed["all"][:, code], 6, axis=1)

    return of


PROGRAM = """#include <cstdio>
#include <stdint.h>
#include <string.h>
#include "mpucal_apply.h"
{namespaces}
static const unsigned char BLOBS[4][{length}] = {{ {blobs} }};
static void out(const float v[3]) {{ std::printf("%.9g %.9g %.9g ", v[0], v[1], v[2]); }}
int main() {{
    int16_t c[6];
    while (std::scanf("%hd %hd %hd %hd %hd %hd", c, c + 1, c + 2, c + 3, c + 4, c + 5) == 6) {{
        float a[4][3], w[4][3], none[3];
        {calls}
        for (int k = 0; k < 4; k++) {{
            struct mpucal_source blob = {{mpucal_read_memory, BLOBS[k], sizeof BLOBS[k]}};
            struct mpucal accel;
            struct mpucal_gyro gyro;
            struct mpucal_fixed fixed;
            float of[3];
            int32_t whole[3];
            out(a[k]), out(w[k]);
            if (mpucal_load_from(&accel, &blob, 0, 0.0f) || mpucal_load_gyro(&gyro, &blob, 0.0f)) return 1;
            mpucal_apply(&accel, c, of), out(of);
            mpucal_apply_gyro(&gyro, c + 3, of), out(of);
            if (mpucal_fix_accel(&fixed, &accel, (float)(2 << k))) return 2;
            mpucal_apply_fixed(&fixed, c, whole), std::printf("%d %d %d ", whole[0], whole[1], whole[2]);
            if (mpucal_fix_gyro(&fixed, &gyro, (float)(250 << k))) return 3;
            mpucal_apply_fixed(&fixed, c + 3, whole), std::printf("%d %d %d\\n", whole[0], whole[1], whole[2]);
        }}
    }}
}}
"""


def _program(folder, calibrations):
    """Return the program, whose headers are written to the folder."""
    for code, each in enumerate(calibrations):
        (folder / f"range{code}.h").write_text(form("c-header").export(each)[0])
    namespaces = "\n".join(
        f'namespace r{code} {{\n#include "range{code}.h"\n}}\n#undef MPUCAL_CALIBRATION_H' for code in range(4)
    )
    calls = "".join(
        f"if (!r{code}::mpucal_correct_counts(c, {g}, a[{code}])"
        f" || !r{code}::mpucal_correct_gyro_counts(c + 3, {dps}, w[{code}])) return 4;\n"
        f"if (r{code}::mpucal_correct_counts(c, {g} / 2, none)"
        f" || r{code}::mpucal_correct_gyro_counts(c + 3, {dps} / 2, none)) return 5;\n"
        for code, (g, dps) in enumerate(RANGES)
    )
    blobs = [each.blob().encode() for each in calibrations]
    text = ", ".join("{" + ", ".join(map(str, blob)) + "}" for blob in blobs)
    return PROGRAM.format(namespaces=namespaces, calls=calls, blobs=text, length=len(blobs[0]))


def test_the_c_header_and_mpucal_apply(ranged, calibration, in_c):
    code, _, a, w = ranged
    header_a, header_w, blob_a, blob_w, fixed_a, fixed_w = in_c(calibration, code)
    for of_header, of_blob, wanted, atol in ((header_a, blob_a, a, ATOL_A), (header_w, blob_w, w, ATOL_W)):
        np.testing.assert_allclose(of_header, wanted, atol=atol)
        np.testing.assert_allclose(of_blob, wanted, atol=atol)
    # in counts
    assert np.abs(fixed_a - a / reg.mps2_per_lsb(code)).max() < 0.6
    assert np.abs(fixed_w - w / reg.rad_s_per_lsb(code)).max() < 0.6


def test_the_factors_for_the_rates_of_libraries(ranged, words):
    """Divide the counts as the libraries do, whose sources were compiled; see losses.scale_of_rates."""
    code, calibration, _, w = ranged
    (note,) = [note for note in form("c-header").export(calibration)[1] if note.startswith("Rates")]
    rounded = {"Adafruit_MPU6050 and MPU6050_light": (131, 65.5, 32.8, 16.4)[code], "FastIMU": 32768 / RANGES[code][1]}
    for library, lsb_per_dps in rounded.items():
        factor = re.search(rf"{library} by ([\d.]+)", note)
        assert factor or lsb_per_dps == reg.GYRO_LSB_PER_DPS[code]
        rates = np.radians(words[:, 3:] / lsb_per_dps) * (float(factor[1]) if factor else 1.0)
        np.testing.assert_allclose(calibration.apply(np.zeros((len(words), 3)), rates)[1], w, rtol=2e-6, atol=1e-6)


def test_micropythons_module(ranged, words):
    code, calibration, a, w = ranged
    module = {}
    exec(form("micropython").export(calibration)[0], module)
    g, dps = RANGES[code]
    np.testing.assert_allclose([module["apply_counts"](row[:3], g) for row in words.tolist()], a, atol=1e-6)
    np.testing.assert_allclose([module["apply_gyro_counts"](row[3:], dps) for row in words.tolist()], w, atol=1e-6)


def test_a_blob_and_the_document_of_one_calibration_agree(ranged, words):
    """Include a blob before version 2, which lacks its counts and refers to the same ones."""
    code, calibration, a, w = ranged
    for gyro_counts in (None, 32750.0):
        blob = replace(calibration.blob(), gyro_counts=gyro_counts)
        of_a, of_w = _samples_applied(Calibration.from_blob(type(blob).decode(blob.encode())), words, code)
        np.testing.assert_allclose(of_a, a, atol=ATOL_A)
        np.testing.assert_allclose(of_w, w, atol=ATOL_W)
