"""Words of a logger that takes the low byte for a signed number, and of those that do not."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration import calibrate
from mpucal.calibration.words import correct_signed_bytes, words_of
from mpucal.data import Sensor
from mpucal.recheck.observed import observe

G = 9.82
LSB, GYRO_LSB = 4.0 * 9.80665 / 32768, np.deg2rad(500.0 / 32750)


@pytest.fixture(scope="module")
def sound(in_hand):
    """Recording of whole counts, as its file may hold it."""
    r = in_hand.recording
    return replace(
        r, acc=np.rint(r.acc / LSB) * LSB, gyr=np.rint(r.gyr / GYRO_LSB) * GYRO_LSB, sensor=Sensor(accel_range_g=4.0)
    )


def read_signed(recording, axes=slice(None)):
    """Return the recording with low bytes taken for signed, by arithmetic of bytes."""

    def misread(values, lsb):
        words = np.rint(values[:, axes] / lsb).astype("<i2")
        low, high = np.ascontiguousarray(words)[..., None].view(np.int8).transpose(2, 0, 1).astype(int)
        changed = values.copy()
        changed[:, axes] = (256 * high + low) * lsb
        return changed

    return replace(recording, acc=misread(recording.acc, LSB), gyr=misread(recording.gyr, GYRO_LSB))


def test_words_read_with_a_signed_low_byte_are_corrected_exactly(sound):
    corrected, axes = correct_signed_bytes(read_signed(sound))
    assert axes == "the accelerometer's x, y, z and the gyroscope's x, y, z"
    np.testing.assert_allclose(corrected.acc, sound.acc, rtol=1e-12)
    np.testing.assert_allclose(corrected.gyr, sound.gyr, rtol=1e-12)


def test_only_the_axes_that_were_misread_are_corrected(sound):
    corrected, axes = correct_signed_bytes(read_signed(sound, slice(1, 2)))
    assert axes == "the accelerometer's y and the gyroscope's y"
    np.testing.assert_allclose(corrected.acc, sound.acc, rtol=1e-12)


def torn(recording):
    """Each high byte is of the sample before."""
    counts = np.rint(recording.acc / LSB).astype(int)
    return replace(recording, acc=LSB * np.vstack([counts[:1], (counts[:-1] & ~0xFF) | (counts[1:] & 0xFF)]))


def in_other_units(recording):
    return replace(recording, acc=1.001 * recording.acc, gyr=np.full(recording.gyr.shape, np.nan))


@pytest.mark.parametrize("change", [lambda recording: recording, torn, in_other_units], ids=["sound", "torn", "units"])
def test_other_words_stay_as_they_are(sound, change):
    recording = change(sound)
    assert correct_signed_bytes(recording) == (recording, "")


def test_at_rest_an_axis_follows_the_others(sound):
    """Infer from the others how a constant axis, which shows nothing, was read."""
    resting = replace(sound, acc=np.column_stack([sound.acc[:, :2], np.full(len(sound), 8000 * LSB + 0xC0 * LSB)]))
    corrected, axes = correct_signed_bytes(read_signed(resting))
    assert axes.startswith("the accelerometer's x, y, z")
    np.testing.assert_allclose(corrected.acc, resting.acc, rtol=1e-12)


@pytest.mark.parametrize("counts", [32750, 32768], ids=["of the data sheet", "of 16 bits"])
def test_counts_of_both_conventions_are_known(sound, counts):
    gyr = np.deg2rad(500.0 / counts) * np.rint(sound.gyr / GYRO_LSB)
    found = words_of(replace(sound, gyr=gyr))[1]
    np.testing.assert_array_equal(found.counts, np.rint(sound.gyr / GYRO_LSB))


def test_the_calibration_is_that_of_the_true_words_and_says_so(sound):
    expected, found = (calibrate(recording, "hand", G) for recording in (sound, read_signed(sound)))
    np.testing.assert_allclose(found.D, expected.D, atol=1e-8)
    np.testing.assert_allclose(found.b_a, expected.b_a, atol=1e-7)
    assert found.verdict == "usable"
    assert [reason["code"] for reason in found.quality["reasons"]] == ["low_byte_signed"]
    assert "(uint8_t)low" in found.quality["reasons"][0]["remedy"]


def test_a_check_sees_the_true_words_too(sound):
    calibration = calibrate(sound, "hand", G)
    expected, found = (observe(recording, calibration) for recording in (sound, read_signed(sound)))
    np.testing.assert_allclose(found.r, expected.r, atol=1e-9)
