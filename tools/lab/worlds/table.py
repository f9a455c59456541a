"""The families: one row of data each, most of them a base with one thing changed.

What is compared as the truth is D and b_a as drawn, in the body frame in which K is symmetric. Where b_a or D moves
(steps, slips, warmth, stress), it is the mean over the recording after the flat segment; of a nonlinear sensor, the
slope at zero; where a calibration names an unlikely gravity, D in units of it. What befalls words and times was
reported by owners of such chips; sources stand beside those rows.
"""

from __future__ import annotations

import math
from dataclasses import replace

from mpucal.data import STANDARD_GRAVITY_MPS2

from .around import Carried, Coning, Elevator, Hand, Sinking, Swing, Thumps, Vibration, Walking
from .changes import GyroMoves, Slip, Stress, Teleport, Warming, ZeroStep
from .chip import Chip
from .course import Arcs, Continuous, OnAChair, Poses, Spins
from .digits import Flipped, LowByteZero, SignedLow, Torn
from .family import PLAIN, SHARP, Family
from .faults import CrossClipped, Flicker, GyroNonlinear, Hobby, Hysteresis, Nonlinear, Ripple, SenseOfGravity, Swapped
from .sampling import Sampling
from .timing import Bursts, Dropped, EachTwice, Jitter, Polled, Ticks

TREMBLING = Hand(tremor_mps2=0.1, tremor_dps=0.6)
# what turns about the sensor itself, and shakes nothing
STEADY = Hand(lever_m=(0.0, 0.0), sway_mps2=0.0, jerks_per_s=0.0)
QUIET = Chip(accel_noise_ug=1.0, gyro_noise_dps=1e-4, bits=0, name=None)
PHONE = Chip(0.01, 0.005, 0.5, 30.0, 0.01, 0.005, 1.0, 150.0, 0.004, 8.0, 1000.0, name=None)
# an accelerometer of 12 bits at 8 g beside a gyroscope of 16
COARSE = Chip(accel_range_g=8.0, steps=(8.0 * STANDARD_GRAVITY_MPS2 / 2048, math.radians(500.0) / 32768))
# as the ArduPilot simulator's IMU reads: scale and bias, and a gyroscope that is exact but for a slow drift
AUTOPILOT = Chip(0.03, 0.0, 0.0, 30.0, 0.0, 0.0, 0.1, 13.0, 5e-4, bits=0, name="ArduPilot-IMU1", message="HIGHRES_IMU")

POSES = Family("poses")
CONTINUOUS = Family("continuous", motion=Continuous())
BENCH = Family(
    "bench",
    motion=Poses(18, move_s=(1.5, 3.0), hold_s=(2.5, 4.0)),
    hand=Hand((0.0, 0.02), sway_mps2=0.05, jerks_per_s=0.0),
)
WARMING = replace(POSES, faults=(Warming(),))
CLIPPED = replace(POSES, chip=Chip(accel_range_g=1.4), hand=Hand(jerks_per_s=2.0), faults=(CrossClipped(),))
TURNTABLE = Family("turntable", motion=Arcs(), hand=STEADY, sampling=Sampling(100.0), lying_deg=1.0)
VEHICLE = Family(
    "vehicle in a simulator",
    motion=Arcs(20, (60.0, 72.0), (200.0, 330.0)),
    hand=STEADY,
    chip=AUTOPILOT,
    sampling=Sampling(100.0, lowpass_hz=20.0),
    faults=(GyroMoves(0.08),),
    lying_deg=0.0,
)

_PLAIN = (
    POSES,
    replace(POSES, name="poses of a session", flat_known=True, hand=TREMBLING, motion=Poses(back=True)),
    replace(POSES, name="poses trembling", hand=TREMBLING),
    replace(POSES, name="poses filtered", sampling=Sampling(lowpass_hz=44.0)),
    CONTINUOUS,
    replace(POSES, name="phone poses", chip=PHONE, hand=TREMBLING, sampling=Sampling(100.0)),
    replace(CONTINUOUS, name="phone continuous", chip=PHONE, sampling=Sampling(100.0)),
    replace(POSES, name="poses 2 kHz", sampling=Sampling(2000.0)),
    replace(POSES, name="poses 3 ms late", sampling=Sampling(delay_ms=3.0)),
    replace(POSES, name="poses 10 ms late", sampling=Sampling(delay_ms=10.0)),
    replace(CONTINUOUS, name="continuous 3 ms late", sampling=Sampling(delay_ms=3.0)),
    replace(CONTINUOUS, name="continuous 10 ms late", sampling=Sampling(delay_ms=10.0)),
    replace(POSES, name="clock 2 % fast", sampling=Sampling(clock_error=0.02)),
    replace(POSES, name="each sample twice", sampling=Sampling(100.0), timing=(EachTwice(),)),
    Family("spins", motion=Spins()),
    BENCH,
)

_SHARP = (
    replace(POSES, name="quiet poses", hand=STEADY, chip=QUIET),
    replace(CONTINUOUS, name="quiet continuous", hand=STEADY, chip=QUIET),
    replace(BENCH, name="quiet bench", hand=STEADY, chip=QUIET),
    replace(TURNTABLE, name="quiet turntable", chip=QUIET),
    VEHICLE,
    replace(VEHICLE, name="vehicle reset at the end", faults=(GyroMoves(0.08), Teleport())),
)

_MOVED = (
    TURNTABLE,
    replace(POSES, name="walking poses", around=(Walking(),)),
    replace(CONTINUOUS, name="walking continuous", around=(Walking(),)),
    replace(POSES, name="passed between hands", hand=Hand(passes=4)),
    replace(CONTINUOUS, name="continuous passed between hands", hand=Hand(passes=6)),
    replace(CONTINUOUS, name="pivot wobbles", hand=Hand(wobble=1.0)),
    replace(CONTINUOUS, name="slow continuous", motion=Continuous(rms_dps=12.0, band_hz=(0.02, 0.15))),
    replace(CONTINUOUS, name="short continuous", motion=Continuous(15.0)),
    replace(POSES, name="six poses", motion=Poses(6)),
    Family("one axis", motion=Spins((0,), 0)),
    replace(POSES, name="vibration after flat", around=(Vibration(),)),
    replace(CONTINUOUS, name="continuous vibration after flat", around=(Vibration(),)),
    replace(POSES, name="vibration throughout", around=(Vibration(flat_too=True),)),
    replace(POSES, name="coning 5 Hz", around=(Coning(),), sampling=Sampling(100.0)),
    replace(POSES, name="elevator", around=(Elevator(),)),
    replace(POSES, name="turning chair", motion=OnAChair(), hand=Hand((0.2, 0.5), passes=8)),
    replace(POSES, name="swing", around=(Swing(),)),
    replace(CONTINUOUS, name="continuous in a swing", around=(Swing(),)),
    replace(POSES, name="train", around=(Carried(),)),
    replace(POSES, name="set down with thumps", around=(Thumps(),)),
    replace(POSES, name="soft ground", around=(Sinking(),)),
)

_SENSORS = (
    replace(POSES, name="nonlinear poses", faults=(Nonlinear(),)),
    replace(BENCH, name="nonlinear bench", faults=(Nonlinear(),)),
    replace(BENCH, name="gyro nonlinear bench", faults=(GyroNonlinear(),)),
    replace(POSES, name="g-sensitivity poses", faults=(SenseOfGravity(),)),
    replace(BENCH, name="g-sensitivity bench", faults=(SenseOfGravity(),)),
    replace(POSES, name="hysteresis poses", faults=(Hysteresis(),)),
    replace(BENCH, name="hysteresis bench", faults=(Hysteresis(),)),
    replace(BENCH, name="1/f bench", faults=(Flicker(),)),
    replace(BENCH, name="bench 25 Hz", sampling=Sampling(25.0)),
    replace(CONTINUOUS, name="gyro drift continuous", motion=Continuous(80.0), faults=(GyroMoves(1.0),)),
    replace(POSES, name="gyro drift poses", motion=Poses(20), faults=(GyroMoves(1.0),)),
    replace(POSES, name="gyro step poses", faults=(GyroMoves(step_dps=4.0),)),
    replace(CONTINUOUS, name="gyro step continuous", faults=(GyroMoves(step_dps=4.0),)),
    replace(WARMING, name="warming 20 minutes", motion=Poses(310), sampling=Sampling(50.0, fine_hz=500.0)),
    replace(POSES, name="warm hand", faults=(Warming(8.0, 40.0),)),
    replace(POSES, name="zero steps 3 mg", faults=(ZeroStep(3.0),)),
    replace(POSES, name="zero steps 10 mg", faults=(ZeroStep(10.0),)),
    replace(POSES, name="zero steps 30 mg", faults=(ZeroStep(30.0),)),
    replace(CONTINUOUS, name="zero steps 30 mg continuous", faults=(ZeroStep(30.0),)),
    replace(POSES, name="mount slips", faults=(Slip(),)),
    replace(POSES, name="mount resonates", sampling=Sampling(mount_hz=25.0), hand=TREMBLING),
    replace(POSES, name="board under stress", faults=(Stress(),)),
    replace(POSES, name="axes swapped", faults=(Swapped(),)),
    replace(POSES, name="accelerometer turned", faults=(Swapped(-1.0),)),
    replace(CLIPPED, name="clips across axes"),
    replace(POSES, name="far off", chip=Chip(gain=0.1, bias_mg=250.0, cross=0.05)),
    replace(POSES, name="gyro clips", motion=Poses(move_s=(0.5, 0.9)), chip=Chip(gyro_range_dps=250.0)),
    replace(POSES, name="supply ripples", faults=(Ripple(),)),
)

_WORDS = (
    replace(POSES, name="12 bits", chip=COARSE),
    replace(CONTINUOUS, name="12 bits continuous", chip=COARSE),
    replace(POSES, name="low byte 0", digits=(LowByteZero(),)),
    replace(CONTINUOUS, name="low byte 0 continuous", digits=(LowByteZero(),)),
    replace(POSES, name="bits flip", digits=(Flipped(),)),
    # github.com/hiwad-aziz/ros2_mpu6050_driver/issues/4, github.com/OSUrobotics/mpu_6050_driver/issues/2
    replace(POSES, name="words torn", digits=(Torn(),)),
    # github.com/kriswiner/MPU6050/issues/6
    replace(POSES, name="low byte signed", digits=(SignedLow(),)),
    # the examples of many libraries print two decimals
    replace(POSES, name="two decimals", chip=Chip(steps=(0.01, 0.01)), sampling=Sampling(100.0)),
    replace(POSES, name="sketch averages", faults=(Hobby(smooth=0.2),)),
    replace(POSES, name="sketch cuts small rates", faults=(Hobby(dead_dps=1.0),)),
)

_TIMES = (
    replace(POSES, name="jitter poses", timing=(Jitter(),)),
    replace(CONTINUOUS, name="jitter continuous", timing=(Jitter(),)),
    replace(POSES, name="ticks of 4 ms poses", timing=(Ticks(),)),
    replace(CONTINUOUS, name="ticks of 4 ms continuous", timing=(Ticks(),)),
    replace(POSES, name="dropped poses", timing=(Dropped(0.1),)),
    replace(CONTINUOUS, name="dropped continuous", timing=(Dropped(0.1, 0.5),)),
    replace(POSES, name="bursts poses", timing=(Bursts(),)),
    replace(CONTINUOUS, name="bursts continuous", timing=(Bursts(),)),
    replace(POSES, name="polled poses", timing=(Polled(),)),
    replace(CONTINUOUS, name="polled continuous", timing=(Polled(),)),
)

_TOLD = (
    replace(POSES, name="gravity told 9.7", told_gravity=9.7),
    replace(POSES, name="gravity told 9.2", told_gravity=9.2),
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
