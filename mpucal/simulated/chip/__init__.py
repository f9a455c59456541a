"""Simulated MPU-6050, MPU-6500 and relatives in a simulated hand, as a bus; `--bus sim:key=value,...` opens one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np

from ...chip.config import Config
from ...data import STANDARD_GRAVITY_MPS2, Vector
from ...sources.chip import OpenedChip
from ...sources.kind import Request
from ...sources.table import number, whole_number
from ...sources.usb_i2c import I2C_HZ
from ..disturbance import ARMS, USUAL_ARM
from ..faults import OF_CHIP, Fault, Where, begin_mishaps
from ..hands import HANDS
from ..motion import Motion
from ..option_text import SimulationOptions, at_least, faults, one_of, whole
from ..sensor import Feed, SensorFeed, SensorTruth
from .bus import CLOCKS, FaultInjector, SimulatedBus, SimulatedClock
from .chip import Chip
from .models import MODELS, OFFSETS, FactoryTrim

__all__ = ["Chip", "Feed", "SensorTruth", "SimulatedBus", "open_simulated"]


def open_simulated(
    text: str = "sim",
    gravity: float = STANDARD_GRAVITY_MPS2,
    seed: int | None = None,
    clock: SimulatedClock | None = None,
) -> SimulatedBus:
    """Return the simulated chip that `sim:key=value,...` describes.

    Parameters
    ----------
    text : `sim`, or with keys: chip, who_am_i, offsets, seed, hand, arm, pace, fault, rate_error_ppm, D, b_a, K,
        b_omega, noise, temperature_c, khz. gravity : m/s^2 at the board. seed : of its own option.
    clock : in place of that of `pace`.

    Raises
    ------
    UsageError : unknown keys or values.
    """
    options = ChipOptions.parse(text, seed)
    truth = _truth(options, gravity)
    of_hand, of_motion, of_noise, of_trim, of_faults = np.random.default_rng([options.seed, 2]).spawn(5)
    hand, mishaps = HANDS[options.hand](of_hand), begin_mishaps(options.fault)
    motion = Motion(hand, of_motion, gravity, mishaps, ARMS[options.arm])
    model = MODELS[options.chip]._replace(**OFFSETS[options.offsets])
    if options.who_am_i is not None:
        model = model._replace(who_am_i=options.who_am_i)
    factory = FactoryTrim.draw(of_trim, model.family)
    chip = Chip(model, SensorFeed(truth, motion, of_noise), truth.rate_error_ppm, factory)
    clock = clock or CLOCKS[options.pace]()
    faults = FaultInjector(options.fault, chip, clock, of_faults) if options.fault else None
    return SimulatedBus(chip, clock, motion, truth, faults, options.khz)


def _truth(options: ChipOptions, gravity: float) -> SensorTruth:
    """Return the drawn sensor with the options' values, in the frame in which K is symmetric."""
    drawn = SensorTruth.draw(options.seed, options.chip, gravity)
    values = {key: getattr(options, key) for key in ("D", "b_a", "K", "b_omega", "rate_error_ppm", "temperature_c")}
    given: dict[str, Any] = {key: value for key, value in values.items() if value is not None}
    truth, _ = drawn._replace(**given).symmetric()
    return truth._replace(
        accel_noise_density=truth.accel_noise_density * options.noise,
        gyro_noise_density=truth.gyro_noise_density * options.noise,
    )


# Time between two polls of a simulation at full speed, where no operator waits for samples and no host is late.
LONG_POLL_S = 0.25


def with_long_polls(config: Config, real_time: bool) -> Config:
    """Return the configuration with longer times between polls, unless the simulation runs in real time."""
    return config if real_time else replace(config, poll_s=min(LONG_POLL_S, config.longest_s))


def open_source(request: Request) -> OpenedChip:
    """Open the chip that `sim:key=value,...` describes, in the gravity of the plan; see open_simulated."""
    bus = open_simulated(request.value, request.plan.gravity, request.values.get("seed"))
    plan = replace(request.plan, config=with_long_polls(request.plan.config, bus.real_time))
    live, words = bus.real_time, request.words
    return OpenedChip(bus, plan, (bus.hear,), bus.truth_document, words=words, real_time=live, own_process=live)


MATRIX = "nine numbers with / between them, by row, that can be inverted"


def _positive(text: str) -> float:
    if (value := number(text)) <= 0:
        raise ValueError(text)
    return value


def _vector(text: str) -> Vector:
    return np.array([number(part) for part in text.split("/")]).reshape(3)


def _matrix(text: str) -> Vector:
    matrix = np.array([number(part) for part in text.split("/")]).reshape(3, 3)
    if np.linalg.matrix_rank(matrix) < 3:
        raise ValueError(text)
    return matrix


@dataclass(frozen=True)
class ChipOptions(SimulationOptions):
    """Options of a simulated chip and its hand; None: drawn from the seed.

    Vectors and matrices are given by row, as 0.1/0.2/0.3.

    Attributes
    ----------
    chip, hand, arm, pace : a name each. who_am_i : another identity than the chip's own.
    offsets : scale of the accelerometer offsets in LSB/g, or readonly.
    seed : of the sensor, its noise and the hand. rate_error_ppm : of the sample clock.
    D, K : (3, 3). b_a [m/s^2], b_omega [rad/s] : (3,).
    fault : faults with their times. noise : factor of the data sheet's densities. temperature_c : of the die.
    khz : bit rate of the bus.
    """

    chip: Annotated[str, one_of(MODELS)] = "mpu6050"
    who_am_i: Annotated[int | None, (whole_number(0, 0xFF), "a byte such as 0x68")] = None
    offsets: Annotated[str, one_of(OFFSETS)] = "2048"
    seed: Annotated[int, whole(0)] = 0
    hand: Annotated[str, one_of(HANDS)] = "guided"
    arm: Annotated[str, one_of(ARMS)] = USUAL_ARM
    pace: Annotated[str, one_of(CLOCKS)] = "fast"
    fault: Annotated[tuple[Fault, ...], faults(*OF_CHIP, Where.DEFECT, Where.HAND)] = ()
    rate_error_ppm: Annotated[float | None, (number, "a number")] = None
    D: Annotated[Vector | None, (_matrix, MATRIX)] = None
    b_a: Annotated[Vector | None, (_vector, "three numbers with / between them, in m/s^2")] = None
    K: Annotated[Vector | None, (_matrix, MATRIX)] = None
    b_omega: Annotated[Vector | None, (_vector, "three numbers with / between them, in rad/s")] = None
    noise: Annotated[float, at_least(0)] = 1.0
    temperature_c: Annotated[float | None, (number, "a number of degrees Celsius")] = None
    khz: Annotated[float, (_positive, "a number above 0")] = I2C_HZ / 1000
