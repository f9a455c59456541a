"""The share of a bus that the driver takes, 400 kHz I2C or SPI, the samples it loses, and the sample rate it measures.

    python -m tools.bench bus_budget [CAPTURE.mcap] [--seconds 3600] [--seeds 100]

The share is counted from the transactions, as the simulated chip's driver makes them or as a capture holds them: a
transfer over I2C takes 27 bits of addresses and register, 3 of start, repeated start and stop, and 9 a byte; over SPI a
byte of address and 8 bits a byte, registers at 1 MHz and what is measured at 20 MHz. Samples are numbered, so that a
lost one is seen.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np

from mpucal.chip.access import Bus, Transaction
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.chip.families import MPU6500
from mpucal.data import Recording
from mpucal.files.mcap import read_capture
from mpucal.simulated.chip.bus import FastClock, SimulatedBus
from mpucal.simulated.chip.chip import Chip
from mpucal.simulated.chip.models import MODELS, FactoryTrim
from mpucal.sources.replay import Tap
from mpucal.sources.spi import DATA, REGISTER_HZ
from tools.lab.feeds import NUMBERS, NumberedFeed, numbers

from .timing import used

BUS_HZ = 400_000
READ_BITS, WRITE_BITS, BYTE_BITS = 30, 20, 9
FASTEST_PPM = 10_000.0
# chip, rate [Hz], and how late the host may be [s]
BUDGETS = (
    ("mpu6050", 200, 0.020),
    ("mpu6050", 1000, 0.020),
    ("mpu6500", 200, 0.010),
    ("mpu6500", 1000, 0.010),
)


class JitterClock(FastClock):
    """Clock of a host that wakes up to `late_s` too late, at random."""

    def __init__(self, late_s: float, seed: int = 0) -> None:
        super().__init__()
        self._late_ns, self._rng = late_s * 1e9, np.random.default_rng(seed)

    def sleep_until(self, t_ns: int) -> None:
        """Advance to `t_ns` and a random time further."""
        super().sleep_until(t_ns + int(self._rng.uniform(0, self._late_ns)))


def share(transactions: Sequence[Transaction]) -> float:
    """Return the share of the I2C bus's time that the transactions take."""
    bits = sum((READ_BITS if t.op == "read" else WRITE_BITS) + BYTE_BITS * t.count for t in transactions)
    return bits / BUS_HZ / ((transactions[-1].t_ns - transactions[0].t_ns) * 1e-9)


def spi_share(transactions: Sequence[Transaction]) -> float:
    """Return the share of the SPI bus's time that the transactions take, at the clocks of mpucal/sources/spi.py."""
    busy_s = sum(8 * (t.count + 1) / (MPU6500.spi_data_hz if t.register in DATA else REGISTER_HZ) for t in transactions)
    return busy_s / ((transactions[-1].t_ns - transactions[0].t_ns) * 1e-9)


def run(
    model: str,
    rate_hz: float,
    seconds: float,
    late_s: float,
    ppm: float = FASTEST_PPM,
    seed: int = 0,
    share: Callable[[Sequence[Transaction]], float] = share,
) -> tuple[Recording, float, float]:
    """Return the recording on a late host, the share of the bus, and the share of a processor."""
    bus = SimulatedBus(Chip(MODELS[model], NumberedFeed(), ppm, FactoryTrim()), JitterClock(late_s, seed))
    driver, transactions, processor = polled(bus, rate_hz, seconds)
    return driver.recording(), share(transactions), processor


def polled(bus: Bus, rate_hz: float, seconds: float) -> tuple[Driver, list[Transaction], float]:
    """Poll for `seconds`; return the driver, the transactions after its start, and the share of a processor."""
    kept: list[Transaction] = []
    driver = Driver(Tap(bus, kept.append), Config(rate_hz=rate_hz))
    driver.start()
    kept.clear()
    until_ns = driver.now_ns() + seconds * 1e9
    with used() as found:
        while driver.now_ns() < until_ns:
            driver.poll()
    return driver, kept, found.cpu_s / seconds


def lost(recording: Recording) -> int:
    """Return how many samples are missing between the first and the last."""
    return int((np.diff(numbers(recording)) % NUMBERS - 1).sum())


def rate_error_ppm(rate_hz: float, seconds: float, seeds: int) -> float:
    """Return the root mean square of the measured rate's error, on a host 1 ms late."""
    errors = []
    for seed in range(seeds):
        ppm = float(np.random.default_rng(seed).uniform(-8000, 8000))
        recording, _, _ = run("mpu6050", rate_hz, seconds, 0.001, ppm, seed)
        assert recording.sensor.rate_hz is not None
        errors.append((recording.sensor.rate_hz / rate_hz / (1 + ppm * 1e-6) - 1) * 1e6)
    return float(np.sqrt(np.mean(np.square(errors))))


def main(
    capture: Annotated[Path | None, "count its transactions instead"] = None,
    *,
    seconds: Annotated[float, "how long the long run takes, of simulated time"] = 3600.0,
    seeds: Annotated[int, "how often each rate is measured"] = 100,
) -> None:
    """Measure and print."""
    if capture is not None:
        records = read_capture(capture).records
        print(f"{share([r for r in records if isinstance(r, Transaction)]):.1%} of a 400 kHz bus, with the start")
        return
    for model, rate_hz, late_s in BUDGETS:
        recording, of_bus, of_processor = run(model, rate_hz, 60.0, late_s)
        print(
            f"{model} at {rate_hz} Hz, host up to {late_s * 1e3:.0f} ms late: {of_bus:.1%} of the bus,"
            f" {lost(recording)} of {len(recording)} samples lost, {of_processor:.1%} of a processor"
        )
    _, of_bus, _ = run("mpu6500", 1000, 60.0, 0.010, share=spi_share)
    print(f"mpu6500 at 1000 Hz over SPI: {of_bus:.1%} of the bus")
    for model, late_s in (("mpu6050", 0.020), ("mpu6500", 0.010)):
        recording, _, _ = run(model, 1000, seconds, late_s)
        missing = f"{lost(recording)} of {len(recording)} samples lost"
        print(f"{model}, {seconds:.0f} s at 1000 Hz: {missing}", flush=True)
    for rate_hz, after_s in ((1000, 10), (200, 10), (1000, 30)):
        ppm = rate_error_ppm(rate_hz, after_s, seeds)
        print(f"rate at {rate_hz} Hz after {after_s} s: {ppm:.1f} ppm rms, {seeds} seeds", flush=True)
