"""Bits that never change: counts as a chip, a microcontroller or an autopilot delivers them, whole and damaged."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration import calibrate
from mpucal.calibration.checks.bits import bits_stuck
from mpucal.calibration.evidence import Evidence
from mpucal.data import Sensor

G = 9.82
LSB = 4.0 * 9.80665 / 32768
GYRO_LSB = np.deg2rad(500.0 / 250.0 / 131.0)
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
    return bits_stuck(Evidence(recording, G, None, None, "auto"))


def low_byte(acc, gyr):
    acc[:, 0] &= ~0xFF


def low_byte_of_the_gyroscope(acc, gyr):
    gyr[:, 2] &= ~0xFF


def low_byte_later(acc, gyr):
    acc[len(acc) * 2 // 3 :, 1] &= ~0xFF


def low_byte_on_a_bad_bus(acc, gyr):
    low_byte(acc, gyr)
    acc[::60] ^= 1


def high_bit(acc, gyr):
    acc[:, 1] &= ~(1 << 12)


def middle_bit(acc, gyr):
    acc[:, 0] |= 1 << 6


def high_bit_set(acc, gyr):
    acc[:, 1] |= 1 << 13


def sign(acc, gyr):
    acc[:, 2] &= 0x7FFF


@pytest.mark.parametrize(
    ("spoil", "what"),
    [
        (low_byte, "the low 8 bits of the accelerometer's x never move: it reads in steps of 0.31 m/s^2"),
        (low_byte_of_the_gyroscope, "the low 8 bits of the gyroscope's z never move: it reads in steps of 0.068 rad/s"),
        (low_byte_later, "the low 8 bits of the accelerometer's y never move from "),
        (low_byte_on_a_bad_bus, "the low 8 bits of the accelerometer's x never move"),
        (high_bit, "bit 12 of the accelerometer's y never moves"),
        (middle_bit, "bit 6 of the accelerometer's x never moves"),
        (high_bit_set, "bit 13 of the accelerometer's y never moves"),
        (sign, "bit 15 of the accelerometer's z never moves"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_bits_that_never_move_are_named(counted, spoil, what):
    found = against(counted(spoil=spoil))
    assert found.code == "bits_stuck"
    assert found.what.startswith(what)


def test_a_bit_that_died_midway_is_named_across_gaps_and_errors(hand):
    r = hand(3, "continuous").recording
    counts = np.rint(r.acc / LSB).astype(int)
    counts[len(r) // 3 :, 1] &= ~(1 << 12)
    counts[::2000, 1] |= 1 << 12
    recording = replace(r, acc=counts * LSB, gap=np.arange(len(r)) == len(r) * 3 // 4, sensor=KNOWN)
    assert against(recording).what.startswith("bit 12 of the accelerometer's y never moves")


def test_without_a_known_range_steps_are_compared_with_the_other_axes(counted):
    found = against(counted(UNKNOWN, low_byte))
    assert found.what.startswith("the low 8 bits of the accelerometer's x never move")


def test_an_axis_is_judged_beside_axes_as_fine_as_a_float(counted):
    recording = counted(UNKNOWN, low_byte)
    acc = 1.001 * recording.acc
    acc[:2, 1:] = [[0.0, 0.0], [5e-324, 5e-324]]
    assert against(replace(recording, acc=acc)).what.startswith("the low 15 bits of the accelerometer's x")


def test_without_a_known_range_counts_are_recovered(counted):
    assert against(counted(UNKNOWN, middle_bit)).what.startswith("bit 6 of the accelerometer's x never moves")


def test_a_lost_byte_of_all_axes_is_no_coarse_sensor(counted):
    def all_of_them(acc, gyr):
        acc &= ~0xFF

    assert against(counted(spoil=all_of_them)).code == "bits_stuck"


@pytest.mark.parametrize("sensor", [KNOWN, UNKNOWN], ids=["known", "unknown"])
def test_an_honest_sensor_is_not_accused(counted, sensor):
    def twelve_bits(acc, gyr):
        acc &= ~0xF

    assert against(counted(sensor)) is None
    assert against(counted(sensor, twelve_bits)) is None
    assert against(counted(sensor).part(0, 400)) is None  # lying flat


@pytest.mark.parametrize("step", [9.80665e-3, 1e-2], ids=["an autopilot's mG", "two digits"])
@pytest.mark.parametrize("sensor", [KNOWN, UNKNOWN], ids=["known", "unknown"])
def test_a_stream_in_coarse_units_is_not_accused(in_hand, sensor, step):
    r = in_hand.recording
    assert (
        against(replace(r, acc=np.rint(r.acc / step) * step, gyr=np.rint(r.gyr / 1e-3) * 1e-3, sensor=sensor)) is None
    )


def test_a_stream_in_single_precision_is_not_accused(in_hand):
    r = in_hand.recording
    # Near gravity, a float32 is coarser than near zero.
    lying = replace(r.part(0, 400), acc=np.float64(np.float32(r.acc[:400])), gyr=np.float64(np.float32(r.gyr[:400])))
    assert against(lying) is None


@pytest.mark.parametrize(("bits", "verdict"), [(3, "usable"), (8, "refused")])
def test_an_axis_coarser_than_the_calibrations_uncertainty_is_refused(counted, bits, verdict):
    def dead(acc, gyr):
        acc[:, 0] &= -(1 << bits)

    quality = calibrate(counted(spoil=dead), "hand", G).quality
    assert quality["verdict"] == verdict
    assert quality["reasons"][0]["code"] == "bits_stuck"


def test_single_faces_that_were_joined_are_not_accused(in_hand):
    """A bit is the same in all six by chance, and no value between two faces was passed."""
    faces = np.repeat([[6200, 400, 300], [-7900, 500, 200], [80, 8200, 350], [60, -8100, 250], [90, 70, 8300]], 400, 0)
    acc = (faces + np.rint(20.0 * np.random.default_rng(4).standard_normal(faces.shape))) * LSB
    gap = np.arange(len(faces)) % 400 == 0
    part = in_hand.recording.part(0, len(faces))
    joined = replace(part, acc=acc, gyr=np.full(acc.shape, np.nan), sensor=KNOWN, gap=gap)
    assert against(joined) is None
    assert against(replace(joined, gap=np.zeros(len(gap), bool))) is None


def test_a_rate_that_is_turned_a_few_times_is_not_accused_beside_one_that_passes_zero(in_hand):
    n = 2000
    at_zero = -(np.arange(n) % 2)
    turned = np.where(np.arange(n) % 200 < 5, 90, -16)  # of both, bit 6 is set
    gyr = GYRO_LSB * np.column_stack([at_zero, turned, at_zero])
    assert against(replace(in_hand.recording.part(0, n), gyr=gyr, sensor=KNOWN)) is None
