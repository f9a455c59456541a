"""The families: one row of data each, most of them a base with one thing changed.

What is compared as the truth is D and b_a as drawn, in the body frame in which K is symmetric. Where b_a or D moves
(steps, slips, warmth, stress), it is the mean over the recording after the flat segment; of a nonlinear sensor, the
linear one nearest to it; where a calibration names an unlikely gravity, D in units of it. Faults of
words and times are those that owners of such chips have reported; sources stand beside those rows.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Annotated, Any

from mpucal.data import STANDARD_GRAVITY_MPS2

from ..runner import each_seed, names_of
from . import around, course, faults
from .around import Hand
from .family import PLAIN, SHARP, Family
from .sensors import Chip, Sampling

TREMBLING = Hand(tremor_mps2=0.12, tremor_rad_s=math.radians(0.6))
# a hand that turns the sensor about itself, and does not shake
STEADY = Hand(lever_m=(0.0, 0.0), sway_mps2=0.0, jerks_per_s=0.0)
QUIET = Chip(accel_noise_ug=1.0, gyro_noise_dps=1e-4, bits=0, name=None)
PHONE = Chip(0.01, 0.005, 0.5, 30.0, 0.01, 0.005, 1.0, 150.0, 0.004, 8.0, 1000.0, name=None)
# an accelerometer of 12 bits at 8 g beside a gyroscope of 16
COARSE = Chip(accel_range_g=8.0, steps=(8.0 * STANDARD_GRAVITY_MPS2 / 2048, math.radians(500.0) / 32768))
# as the ArduPilot simulator's IMU reads: scale and bias, and a gyroscope that is exact but for a slow drift
AUTOPILOT = Chip(0.03, 0.0, 0.0, 30.0, 0.0, 0.0, 0.1, 13.0, 5e-4, bits=0, name="ArduPilot-IMU1", message="HIGHRES_IMU")
GYRO_DRIFTS, GYRO_STEPS = partial(faults.gyro_moves, drift_dps=1.0), partial(faults.gyro_moves, step_dps=4.0)

POSES = Family("poses")
CONTINUOUS = Family("continuous", motion=course.continuous)
BENCH = Family(
    "bench",
    motion=partial(course.poses, count=18, move_s=(1.5, 3.0), hold_s=(2.5, 4.0)),
    hand=Hand((0.0, 0.02), sway_mps2=0.05, jerks_per_s=0.0),
)
WARMING = replace(POSES, faults=(faults.warming,))
CLIPPED = replace(POSES, chip=Chip(accel_range_g=1.4), hand=Hand(jerks_per_s=2.0), faults=(faults.cross_clipped,))
TURNTABLE = Family("turntable", motion=course.arcs, hand=STEADY, sampling=Sampling(100.0), lying_deg=1.0)
VEHICLE = Family(
    "vehicle in a simulator",
    motion=partial(course.arcs, count=20, rate_dps=(60.0, 72.0), arc_deg=(200.0, 330.0)),
    hand=STEADY,
    chip=AUTOPILOT,
    sampling=Sampling(100.0, lowpass_hz=20.0),
    faults=(partial(faults.gyro_moves, drift_dps=0.08),),
    lying_deg=0.0,
)


def but(base: Family, name: str, **changes: Any) -> Family:
    """The base under another name, with these changes."""
    return replace(base, name=name, **changes)


_PLAIN = (
    POSES,
    but(POSES, "poses of a session", flat_known=True, hand=TREMBLING, motion=partial(course.poses, back=True)),
    but(POSES, "poses trembling", hand=TREMBLING),
    but(POSES, "poses filtered", sampling=Sampling(lowpass_hz=44.0)),
    CONTINUOUS,
    but(POSES, "phone poses", chip=PHONE, hand=TREMBLING, sampling=Sampling(100.0)),
    but(CONTINUOUS, "phone continuous", chip=PHONE, sampling=Sampling(100.0)),
    but(POSES, "poses 2 kHz", sampling=Sampling(2000.0, fine_hz=4000.0)),
    but(POSES, "poses 3 ms late", sampling=Sampling(delay_ms=3.0)),
    but(POSES, "poses 10 ms late", sampling=Sampling(delay_ms=10.0)),
    but(CONTINUOUS, "continuous 3 ms late", sampling=Sampling(delay_ms=3.0)),
    but(CONTINUOUS, "continuous 10 ms late", sampling=Sampling(delay_ms=10.0)),
    but(POSES, "clock 2 % fast", sampling=Sampling(clock_error=0.02)),
    but(POSES, "each sample twice", sampling=Sampling(100.0), timing=(faults.each_twice,)),
    Family("spins", motion=course.spins),
    BENCH,
)

_SHARP = (
    but(POSES, "quiet poses", hand=STEADY, chip=QUIET),
    but(CONTINUOUS, "quiet continuous", hand=STEADY, chip=QUIET),
    but(BENCH, "quiet bench", hand=STEADY, chip=QUIET),
    but(TURNTABLE, "quiet turntable", chip=QUIET),
    VEHICLE,
    but(VEHICLE, "vehicle reset at the end", faults=(partial(faults.gyro_moves, drift_dps=0.08), faults.teleport)),
)

_MOVED = (
    TURNTABLE,
    but(POSES, "walking poses", around=(around.walking,)),
    but(CONTINUOUS, "walking continuous", around=(around.walking,)),
    but(POSES, "passed between hands", hand=Hand(passes=4)),
    but(CONTINUOUS, "continuous passed between hands", hand=Hand(passes=6)),
    but(CONTINUOUS, "pivot wobbles", hand=Hand(wobble=1.0)),
    but(CONTINUOUS, "slow continuous", motion=partial(course.continuous, rms_dps=12.0, band_hz=(0.02, 0.15))),
    but(CONTINUOUS, "short continuous", motion=partial(course.continuous, seconds=15.0)),
    but(POSES, "six poses", motion=partial(course.poses, count=6)),
    Family("one axis", motion=partial(course.spins, about=(0,), oblique=0)),
    but(POSES, "vibration after flat", around=(around.vibration,)),
    but(CONTINUOUS, "continuous vibration after flat", around=(around.vibration,)),
    but(POSES, "vibration throughout", around=(partial(around.vibration, flat_too=True),)),
    but(POSES, "coning 5 Hz", around=(around.coning,), sampling=Sampling(100.0)),
    but(POSES, "elevator", around=(around.elevator,)),
    but(POSES, "turning chair", motion=course.on_a_chair, hand=Hand((0.2, 0.5), passes=8)),
    but(POSES, "swing", around=(around.swing,)),
    but(CONTINUOUS, "continuous in a swing", around=(around.swing,)),
    but(POSES, "train", around=(around.carried,)),
    but(POSES, "set down with thumps", around=(around.thumps,)),
    but(POSES, "soft ground", around=(around.sinking,)),
)

_SENSORS = (
    but(POSES, "nonlinear poses", faults=(faults.nonlinear,)),
    but(BENCH, "nonlinear bench", faults=(faults.nonlinear,)),
    but(BENCH, "gyro nonlinear bench", faults=(faults.gyro_nonlinear,)),
    but(TURNTABLE, "turntable whose acceleration the gyroscope feels", faults=(faults.gyro_feels,)),
    but(POSES, "g-sensitivity poses", faults=(faults.sense_of_gravity,)),
    but(BENCH, "g-sensitivity bench", faults=(faults.sense_of_gravity,)),
    but(POSES, "hysteresis poses", faults=(faults.hysteresis,)),
    but(BENCH, "hysteresis bench", faults=(faults.hysteresis,)),
    but(BENCH, "1/f bench", faults=(faults.flicker,)),
    but(BENCH, "bench 25 Hz", sampling=Sampling(25.0)),
    but(CONTINUOUS, "gyro drift continuous", motion=partial(course.continuous, seconds=80.0), faults=(GYRO_DRIFTS,)),
    but(POSES, "gyro drift poses", motion=partial(course.poses, count=20), faults=(GYRO_DRIFTS,)),
    but(POSES, "gyro step poses", faults=(GYRO_STEPS,)),
    but(CONTINUOUS, "gyro step continuous", faults=(GYRO_STEPS,)),
    but(WARMING, "warming 20 minutes", motion=partial(course.poses, count=310), sampling=Sampling(50.0, fine_hz=500.0)),
    but(POSES, "warm hand", faults=(partial(faults.warming, by_c=8.0, tau_s=40.0),)),
    but(POSES, "zero steps 3 mg", faults=(partial(faults.zero_step, mg=3.0),)),
    but(POSES, "zero steps 10 mg", faults=(partial(faults.zero_step, mg=10.0),)),
    but(POSES, "zero steps 30 mg", faults=(partial(faults.zero_step, mg=30.0),)),
    but(CONTINUOUS, "zero steps 30 mg continuous", faults=(partial(faults.zero_step, mg=30.0),)),
    but(POSES, "mount slips", faults=(faults.slip,)),
    but(POSES, "mount resonates", sampling=Sampling(mount_hz=25.0), hand=TREMBLING),
    but(POSES, "board under stress", faults=(faults.stress,)),
    but(POSES, "axes swapped", faults=(faults.swapped,)),
    but(POSES, "accelerometer turned", faults=(partial(faults.swapped, sign=-1.0),)),
    but(CLIPPED, "clips across axes"),
    but(POSES, "far off", chip=Chip(gain=0.1, bias_mg=250.0, cross=0.05)),
    but(POSES, "gyro clips", motion=partial(course.poses, move_s=(0.5, 0.9)), chip=Chip(gyro_range_dps=250.0)),
    but(POSES, "supply ripples", faults=(faults.ripple,)),
)

_WORDS = (
    but(POSES, "12 bits", chip=COARSE),
    but(CONTINUOUS, "12 bits continuous", chip=COARSE),
    but(POSES, "low byte 0", digits=(faults.low_byte_zero,)),
    but(CONTINUOUS, "low byte 0 continuous", digits=(faults.low_byte_zero,)),
    but(POSES, "bits flip", digits=(faults.flipped,)),
    # github.com/hiwad-aziz/ros2_mpu6050_driver/issues/4, github.com/OSUrobotics/mpu_6050_driver/issues/2
    but(POSES, "words torn", digits=(faults.torn,)),
    # github.com/kriswiner/MPU6050/issues/6
    but(POSES, "low byte signed", digits=(faults.signed_low,)),
    # the examples of many libraries print two decimals
    but(POSES, "two decimals", chip=Chip(steps=(0.01, 0.01)), sampling=Sampling(100.0)),
    but(POSES, "sketch averages", faults=(partial(faults.hobby, smooth=0.2),)),
    but(POSES, "sketch cuts small rates", faults=(partial(faults.hobby, dead_dps=1.0),)),
)

_TIMES = (
    but(POSES, "jitter poses", timing=(faults.jitter,)),
    but(CONTINUOUS, "jitter continuous", timing=(faults.jitter,)),
    but(POSES, "ticks of 4 ms poses", timing=(faults.ticks,)),
    but(CONTINUOUS, "ticks of 4 ms continuous", timing=(faults.ticks,)),
    but(POSES, "dropped poses", timing=(partial(faults.dropped, share=0.1),)),
    but(CONTINUOUS, "dropped continuous", timing=(partial(faults.dropped, share=0.1, stretch_s=0.5),)),
    but(POSES, "bursts poses", timing=(faults.bursts,)),
    but(CONTINUOUS, "bursts continuous", timing=(faults.bursts,)),
    but(POSES, "polled poses", timing=(faults.polled,)),
    but(CONTINUOUS, "polled continuous", timing=(faults.polled,)),
)

_TOLD = (
    but(POSES, "gravity told 9.7", told_gravity=9.7),
    but(POSES, "gravity told 9.2", told_gravity=9.2),
)

FAMILIES: dict[str, Family] = {
    family.name: family
    for family in (
        *(replace(family, wanted=PLAIN) for family in _PLAIN),
        *(replace(family, wanted=SHARP) for family in _SHARP),
        *_MOVED,
        *_SENSORS,
        *_WORDS,
        *_TIMES,
        *_TOLD,
    )
}


def of_families(
    *,
    seeds: range,
    families: Annotated[Sequence[str], names_of(FAMILIES), "patterns, with ; between"] = tuple(FAMILIES),
) -> list[tuple[str, int]]:
    """Return each family with each seed."""
    return each_seed(families, seeds)
