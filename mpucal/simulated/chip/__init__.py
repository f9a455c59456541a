"""Simulated MPU-6050, MPU-6500 and relatives in a simulated hand, as a bus."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...data import STANDARD_GRAVITY_MPS2
from ..disturbance import ARMS
from ..faults import begin_mishaps
from ..hands import HANDS
from ..mishaps import Mishap
from ..motion import Motion
from ..sensor import SensorTruth
from .bus import SimulatedBus
from .chip import Chip
from .clock import CLOCKS, FastClock, SimulatedClock
from .factory import FactoryTrim
from .fault_injector import FaultInjector
from .feed import Feed, RecordedFeed, SensorFeed
from .models import MODELS, OFFSETS
from .options import ChipOptions

__all__ = ["Chip", "Feed", "RecordedFeed", "SensorTruth", "SimulatedBus", "open_recorded", "open_simulated"]


def open_simulated(
    text: str = "sim",
    gravity: float = STANDARD_GRAVITY_MPS2,
    seed: int | None = None,
    clock: SimulatedClock | None = None,
    mishaps: Sequence[Mishap] = (),
) -> SimulatedBus:
    """Return the simulated chip that `sim:key=value,...` describes.

    Parameters
    ----------
    text : `sim`, or with keys: chip, who_am_i, offsets, seed, hand, arm, pace, fault, rate_error_ppm, D, b_a, K,
        b_omega, noise, temperature_c, khz. gravity : m/s^2 at the board. seed : of its own option.
    mishaps : of the sensor, besides the faults of the text.
    clock : in place of that of `pace`.

    Raises
    ------
    UsageError : unknown keys or values.
    """
    options = ChipOptions.parse(text, seed)
    truth = _truth(options, gravity)
    of_hand, of_motion, of_noise, of_trim, of_faults = np.random.default_rng([options.seed, 2]).spawn(5)
    mishaps = (*begin_mishaps(options.fault), *mishaps)
    motion = Motion(HANDS[options.hand](of_hand), of_motion, gravity, mishaps, ARMS[options.arm])
    model = replace(MODELS[options.chip], **OFFSETS[options.offsets])
    if options.who_am_i is not None:
        model = replace(model, who_am_i=options.who_am_i)
    factory = FactoryTrim.draw(of_trim, model.family)
    chip = Chip(model, SensorFeed(truth, motion, of_noise), truth.rate_error_ppm, factory)
    clock = clock or CLOCKS[options.pace]()
    faults = FaultInjector(options.fault, chip, clock, of_faults) if options.fault else None
    return SimulatedBus(chip, clock, motion, truth, faults, options.khz)


def open_recorded(
    acc_counts: ArrayLike,
    gyr_counts: ArrayLike,
    rate_hz: float,
    accel_range_g: float,
    gyro_range_dps: float,
    *,
    rate_error_ppm: float = 0.0,
    chip: str = "mpu6050",
) -> SimulatedBus:
    """Return a simulated chip that serves the int16 counts (n, 3) of a recording, then raises EndOfCapture.

    Its sample clock is `rate_error_ppm` faster than `rate_hz`, which the driver must set.

    Raises
    ------
    RecordingError : counts that are not int16, or different numbers of them.
    """
    feed = RecordedFeed(acc_counts, gyr_counts, rate_hz, accel_range_g, gyro_range_dps)
    return SimulatedBus(Chip(MODELS[chip], feed, rate_error_ppm), FastClock())


def _truth(options: ChipOptions, gravity: float) -> SensorTruth:
    """Return the drawn sensor with the options' values, in the frame in which K is symmetric."""
    drawn = SensorTruth.draw(options.seed, options.chip, gravity)
    values = {key: getattr(options, key) for key in ("D", "b_a", "K", "b_omega", "rate_error_ppm", "temperature_c")}
    given: dict[str, Any] = {key: value for key, value in values.items() if value is not None}
    truth, _ = replace(drawn, **given).symmetric()
    return replace(
        truth,
        accel_noise_density=truth.accel_noise_density * options.noise,
        gyro_noise_density=truth.gyro_noise_density * options.noise,
    )
