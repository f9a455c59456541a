"""Words of a chip: bits that never change, and a low byte taken for a signed number; whole and damaged counts."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration import calibrate
from mpucal.calibration.words import decode
from mpucal.data import Recording, Sensor
from mpucal.recheck.observed import observe

G = 9.82
LSB, GYRO_LSB = 4.0 * 9.80665 / 32768, np.deg2rad(500.0 / 32750)
KNOWN, UNKNOWN = Sensor(accel_range_g=4.0, gyro_range_dps=500.0), Sensor()


@pytest.fixture(scope="module")
def counted(in_hand):
    """Return a function that makes counts of a good recording; `spoil` changes them in place."""

    def make(sensor=KNOWN, spoil=lambda acc, gyr: None):
        r = in_hand.recording
        acc, gyr = np.rint(r.acc / LSB).astype(int), np.rint(r.gyr / GYRO_LSB).astype(int)
        spoil(acc, gyr)
        return replace(r, acc=acc * LSB, gyr=gyr * GYRO_LSB, sensor=sensor)

    return make


def against(recording):
    """Return the sentence about bits that never move; None where there is none."""
    said = calibrate(recording, "static", G).quality["reasons"]  # the fastest model
    return next((reason["message"] for reason in said if reason["code"] == "bits_stuck"), None)


def dead(axes, zeros, ones=0, gyroscope=False, since=0.0):
    """Return a function that keeps bits of some axes at zero or one, from this share of the time on."""

    def spoil(acc, gyr):
        counts = (gyr if gyroscope else acc)[round(since * len(acc)) :]
        counts[:, axes] = counts[:, axes] & ~zeros | ones

    return spoil


def on_a_bad_bus(acc, gyr):
    acc[:, 0] &= ~0xFF
    acc[::60] ^= 1


@pytest.mark.parametrize(
    ("spoil", "sensor", "what"),
    [
        (dead(0, 0xFF), KNOWN, "the low 8 bits of the accelerometer's x never move: it reads in steps of 0.31 m/s^2"),
        (dead(0, 0xFF), UNKNOWN, "the low 8 bits of the accelerometer's x never move"),
        (dead(2, 0xFF, gyroscope=True), KNOWN, "the low 8 bits of the gyroscope's z never move: it reads in steps of "),
        (dead(1, 0xFF, since=0.67), KNOWN, "the low 8 bits of the accelerometer's y never move from "),
        (dead(slice(3), 0xFF), KNOWN, "the low 8 bits of the accelerometer's"),
        (on_a_bad_bus, KNOWN, "the low 8 bits of the accelerometer's x never move"),
        (dead(0, 0, ones=1 << 6), UNKNOWN, "bit 6 of the accelerometer's x never moves"),
        (dead(1, 0, ones=1 << 13), KNOWN, "bit 13 of the accelerometer's y never moves"),
        (dead(2, ~0x7FFF), KNOWN, "bit 15 of the accelerometer's z never moves"),
    ],
)
def test_bits_that_never_move_are_named(counted, spoil, sensor, what):
    assert against(counted(sensor, spoil)).startswith(what)


def test_a_bit_that_died_midway_is_named_across_gaps_and_errors(hand):
    r = hand(3, "continuous").recording
    counts = np.rint(r.acc / LSB).astype(int)
    counts[len(r) // 3 :, 1] &= ~(1 << 12)
    counts[::2000, 1] |= 1 << 12
    recording = replace(r, acc=counts * LSB, gap=np.arange(len(r)) == len(r) * 3 // 4, sensor=KNOWN)
    assert against(recording).startswith("bit 12 of the accelerometer's y never moves")


def test_an_axis_is_judged_beside_the_others_where_no_range_is_known(counted):
    recording = counted(UNKNOWN, dead(0, 0xFF))
    acc = 1.001 * recording.acc
    assert against(replace(recording, acc=acc)).startswith("the low 8 bits of the accelerometer's x")
    acc[:2, 1:] = [[0.0, 0.0], [5e-324, 5e-324]]  # computed values have no counts
    assert against(replace(recording, acc=acc)) is None


@pytest.mark.parametrize("sensor", [KNOWN, UNKNOWN], ids=["known", "unknown"])
def test_an_honest_sensor_and_a_stream_in_coarse_units_are_not_accused(counted, sensor):
    r = counted(sensor)
    assert against(r) is None
    assert against(counted(sensor, dead(slice(3), 0xF))) is None
    for step in (9.80665e-3, 1e-2):  # steps of an autopilot's mG, and of two decimals
        coarse = replace(r, acc=np.rint(r.acc / step) * step, gyr=np.rint(r.gyr / 1e-3) * 1e-3)
        assert against(coarse) is None


def test_hammering_that_swings_by_whole_steps_is_no_stuck_bit(counted):
    """Shake y by 560 counts in every other sample, by 816 in one of twelve: bit 8 changes in a sixth of the steps."""
    at = np.arange(1500)
    shaken = 560 * (at % 2) + 256 * (at % 12 == 1) + np.random.default_rng(0).integers(-20, 20, len(at))

    def hammering(acc, gyr):
        acc[-len(at) :, 1] = 2176 + shaken

    assert against(counted(spoil=hammering)) is None


def test_blows_of_half_the_range_are_no_stuck_sign(counted):
    def with_blows(acc, gyr):
        at, rng = np.arange(25), np.random.default_rng(2)
        acc[:, 0] = np.abs(acc[:, 0])
        for first in range(500, len(acc) - 25, 100):
            ring = rng.uniform(18000, 26000) * np.exp(-at / 2.0) * np.sin(1.9 * (at + rng.uniform()))
            acc[first : first + 25, 0] = np.minimum(acc[first : first + 25, 0] + ring.astype(int), 32767)

    assert against(counted(spoil=with_blows)) is None


@pytest.mark.parametrize(("bits", "verdict"), [(3, "usable"), (8, "refused")])
def test_an_axis_coarser_than_the_calibrations_uncertainty_is_refused(counted, bits, verdict):
    quality = calibrate(counted(spoil=dead(0, (1 << bits) - 1)), "hand", G).quality
    assert quality["verdict"] == verdict
    assert quality["reasons"][0]["code"] == "bits_stuck"


def test_single_faces_that_were_joined_are_not_accused():
    """A bit may be the same on all six faces by chance, as the values between two faces are missing."""
    faces = np.repeat([[60, -8100, 250], [6200, 400, 300], [-7900, 500, 200], [80, 8200, 350], [90, 70, 8300]], 400, 0)
    acc = (faces + np.rint(20.0 * np.random.default_rng(4).standard_normal(faces.shape))) * LSB
    gap = np.arange(len(faces)) % 400 == 0
    gyr = GYRO_LSB * np.rint(0.002 * np.random.default_rng(5).standard_normal(acc.shape) / GYRO_LSB)
    joined = replace(Recording.from_arrays(0.01 * np.arange(len(acc)), acc, gyr), sensor=KNOWN)
    assert against(replace(joined, gap=gap)) is None
    assert against(joined) is None


# ---- a low byte that was taken for a signed number


def read_signed(recording, axes=slice(None)):
    """Return the recording with low bytes taken for signed, by arithmetic of bytes."""

    def misread(values, lsb):
        words = np.rint(values[:, axes] / lsb).astype("<i2")
        low, high = np.ascontiguousarray(words)[..., None].view(np.int8).transpose(2, 0, 1).astype(int)
        changed = values.copy()
        changed[:, axes] = (256 * high + low) * lsb
        return changed

    return replace(recording, acc=misread(recording.acc, LSB), gyr=misread(recording.gyr, GYRO_LSB))


@pytest.fixture(scope="module")
def sound(counted):
    """Recording of whole counts, as its file may hold it."""
    return counted(Sensor(accel_range_g=4.0))


@pytest.mark.parametrize(("axes", "names"), [(slice(None), "x, y, z"), (slice(1, 2), "y")], ids=["all", "y"])
def test_words_read_with_a_signed_low_byte_are_corrected_exactly(sound, axes, names):
    corrected, _, said = decode(read_signed(sound, axes))
    assert said == f"the accelerometer's {names} and the gyroscope's {names}"
    np.testing.assert_allclose(corrected.acc, sound.acc, rtol=1e-12)
    np.testing.assert_allclose(corrected.gyr, sound.gyr, rtol=1e-12)


def torn(recording):
    """Each high byte is of the sample before."""
    counts = np.rint(recording.acc / LSB).astype(int)
    return replace(recording, acc=LSB * np.vstack([counts[:1], (counts[:-1] & ~0xFF) | (counts[1:] & 0xFF)]))


def in_other_units(recording):
    return replace(recording, acc=1.001 * recording.acc, gyr=np.full(recording.gyr.shape, np.nan))


@pytest.mark.parametrize("change", [lambda recording: recording, torn, in_other_units], ids=["sound", "torn", "units"])
def test_other_words_stay_as_they_are(sound, change):
    recording = change(sound)
    assert (decode(recording).recording, decode(recording).corrected) == (recording, "")


def test_words_of_a_resting_axis_are_decoded_like_the_others(sound):
    """A constant axis does not show how its words were read: infer it from the other axes."""
    resting = replace(sound, acc=np.column_stack([sound.acc[:, :2], np.full(len(sound), 8000 * LSB + 0xC0 * LSB)]))
    corrected, _, axes = decode(read_signed(resting))
    assert axes.startswith("the accelerometer's x, y, z")
    np.testing.assert_allclose(corrected.acc, resting.acc, rtol=1e-12)


def test_signed_low_bytes_are_corrected_and_reported_in_calibrations_and_checks(sound):
    expected, found = (calibrate(recording, "hand", G) for recording in (sound, read_signed(sound)))
    np.testing.assert_allclose(found.D, expected.D, atol=1e-8)
    np.testing.assert_allclose(found.b_a, expected.b_a, atol=1e-7)
    assert found.verdict == "usable"
    assert [reason["code"] for reason in found.quality["reasons"]] == ["low_byte_signed"]
    assert "(uint8_t)low" in found.quality["reasons"][0]["remedy"]
    seen = [observe(recording, expected).r for recording in (sound, read_signed(sound))]
    np.testing.assert_allclose(seen[0], seen[1], atol=1e-9)
