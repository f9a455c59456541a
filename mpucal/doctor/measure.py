"""Examination of the samples of a board at rest: rate, losses, noise, gravity, zero rate, temperature."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..chip import registers as reg
from ..chip.access import Bus
from ..chip.families import MPU6050, Family
from ..chip.losses import Loss
from ..clocks.sample_clock import RATE_TOLERANCE
from ..data import MOST_CLOCK_PPM, STANDARD_GRAVITY_MPS2, Recording, Vector
from ..errors import BusError
from .dead_axes import dead_axes, live_axes
from .finding import Finding, Mark

# Multiple of the data sheet's typical noise density, from which on a sensor is noisy, and broken from twice that on.
NOISY_RATIO = 1.5
# Relative change of the sample clock's rate that warming of the chip does not explain.
LEAST_RATE_CHANGE = 0.002
# The samples may be shorter than asked for by the first and the last poll.
MOST_MISSING_S = 0.1
USUAL_C = (-10.0, 70.0)

# Both bands lie above slow drift and below a low-pass filter of 44 Hz; a hand trembles in the lower one only.
LOW_HZ, HIGH_HZ = (1.0, 12.0), (20.0, 40.0)
LEAST_TREMOR_RATIO = 2.0


def examine_stream(
    recording: Recording, nominal_hz: float, seconds: float, family: Family | None, remedy: str
) -> Iterator[Finding]:
    """Examine `seconds` of samples at rest.

    Parameters
    ----------
    family : None if the data sheet is not known. remedy : for gaps.
    """
    if recording.sensor.clock_ppm is not None:
        yield examine_clock("bridge's clock", recording.sensor.clock_ppm, float(recording.sensor.clock_std or np.nan))
    yield _rate(recording, nominal_hz)
    yield _losses(recording, seconds, remedy)
    acc, gyr = recording.acc, np.degrees(recording.gyr)
    hz = float(recording.sensor.rate_hz or nominal_hz)
    yield from dead_axes(recording)
    # A dead axis has no noise, and its rounding would look like a hand's tremor.
    acc_lives, gyr_lives = live_axes(recording)
    if acc_lives.any() and is_trembling(acc[:, acc_lives], hz):
        yield Finding("noise", Mark.UNKNOWN, "the board moved", "put it on a firm surface and try again")
        return
    if acc_lives.any() and family is not None:
        ug = noise_density(acc[:, acc_lives], hz) / STANDARD_GRAVITY_MPS2 * 1e6
        yield _noise("accelerometer noise", ug, family.accel_noise_ug, "ug_rthz", "µg/√Hz")
    if gyr_lives.any() and family is not None:
        noise_dps = noise_density(gyr[:, gyr_lives], hz)
        yield _noise("gyroscope noise", noise_dps, family.gyro_noise_dps, "dps_rthz", "deg/s/√Hz")
    if acc_lives.all():
        yield examine_gravity("at rest", recording.acc.mean(0))
    if family is not None:
        yield _zero_rate(gyr.mean(0).tolist(), family.zero_rate_dps)
    if np.isfinite(recording.temperature_c).any():
        yield _temperature(float(np.nanmean(recording.temperature_c)))


def examine_clock(topic: str, ppm: float, std: float) -> Finding:
    """Examine the rate error of a clock that is not this computer's, and its relative standard deviation."""
    what = f"{ppm:+.0f} ppm against this computer's (1 sigma {std * 1e6:.0f})"
    data = {"ppm": ppm, "std_ppm": std * 1e6}
    remedy = "nothing has to be done: times are corrected for that"
    if std * 1e6 > MOST_CLOCK_PPM:
        remedy = "observe for longer (--seconds 30): its rate is not known yet"
    return Finding.check(topic, max(abs(ppm), std * 1e6) <= MOST_CLOCK_PPM, what, remedy, data)


def _rate(recording: Recording, nominal_hz: float) -> Finding:
    hz = float(recording.sensor.rate_hz or np.nan)
    off = hz / nominal_hz - 1
    # The uncertainty of a bridge's clock is one of the rate, too.
    ok = abs(off) <= RATE_TOLERANCE + 2.0 * (recording.sensor.clock_std or 0.0)
    what = f"{hz:.3f} Hz instead of {nominal_hz:g} Hz, {100 * off:+.2f} % (data sheet: within 1 %)"
    data = {"rate_hz": hz, "nominal_hz": nominal_hz}
    if ok and (change := _find_rate_change(recording)) is not None:
        at_s, before_hz, after_hz = change
        what = f"the chip's clock changed after {at_s:.0f} s: from {before_hz:.3f} to {after_hz:.3f} Hz"
        remedy = "times follow it; if that happens again, check its supply, or replace the chip"
        return Finding("sample rate", Mark.NOTE, what, remedy, data)
    remedy = "the chip's clock is outside its specification: use the measured rate"
    return Finding.check("sample rate", ok, what, remedy, data, Mark.BAD)


def _find_rate_change(recording: Recording) -> tuple[float, float, float] | None:
    """Return the time [s] of a change of the sample clock and the rates [Hz] before and after; None if it is steady."""
    period = np.where(recording.gap[1:], np.nan, np.diff(recording.t))
    if not np.nanmedian(np.abs(np.diff(period))) < LEAST_RATE_CHANGE * np.nanmedian(period):
        # Each sample has a time of its own: the kernel's driver stamps it, or the channels are polled.
        return None
    first, last = float(period[0]), float(period[-1])
    # The comparison is False for NaN, which counts as no change.
    if not abs(last / first - 1) > LEAST_RATE_CHANGE:
        return None
    at = int(np.argmax(np.abs(period / first - 1) > abs(last / first - 1) / 2))
    return float(recording.t[at] - recording.t[0]), 1.0 / first, 1.0 / last


def _losses(recording: Recording, asked_s: float, remedy: str) -> Finding:
    gaps, seconds = int(recording.gap.sum()), float(recording.t[-1] - recording.t[0])
    data = {"samples": len(recording), "seconds": seconds, "gaps": gaps}
    samples = f"{len(recording)} samples in {seconds:.1f} s"
    if gaps:
        return Finding("losses", Mark.BAD, f"{gaps} gap{'' if gaps == 1 else 's'} in {samples}", remedy, data)
    complete = seconds > asked_s - MOST_MISSING_S
    late = "" if complete else f", though {asked_s:g} s were asked for"
    return Finding.check("losses", complete, f"none of {samples}{late}", Loss.LATE.remedy, data)


def _noise(topic: str, measured: np.ndarray, typical: float, key: str, unit: str) -> Finding:
    share = float(measured.max()) / typical
    what = f"{', '.join(f'{value:.3g}' for value in measured)} {unit} (data sheet: {typical:g})"
    data = {key: measured.tolist(), f"typical_{key}": typical}
    remedy = "keep vibration away from the board and check its supply; if that does not help, the chip is noisy"
    mark = Mark.NOTE if share <= 2.0 * NOISY_RATIO else Mark.BAD
    return Finding.check(topic, share <= NOISY_RATIO, what, remedy, data, mark)


def examine_gravity(topic: str, mean: Vector, more: str = "") -> Finding:
    """Examine the mean (3,) [m/s^2] of an accelerometer at rest; `more` is said after it."""
    g = float(np.linalg.norm(mean)) / STANDARD_GRAVITY_MPS2
    most_g = 0.01 * MPU6050.scale_percent + 1e-3 * max(MPU6050.zero_g_mg)
    remedy = "outside the data sheet's scale factor and bias; a calibration corrects it if it is constant"
    return Finding.check(topic, abs(g - 1) <= most_g, f"|a| is {g:.3f} g{more}", remedy, {"g": g})


def _zero_rate(dps: list[float], limit_dps: float) -> Finding:
    what = f"gyroscope bias {', '.join(f'{value:+.2f}' for value in dps)} deg/s (data sheet: within {limit_dps:g})"
    remedy = "a calibration corrects it if it is constant"
    return Finding.check("zero rate", max(map(abs, dps)) <= limit_dps, what, remedy, {"dps": dps})


def _temperature(celsius: float) -> Finding:
    usual = USUAL_C[0] < celsius < USUAL_C[1]
    what = f"{celsius:.1f} °C by the formula of this family"
    remedy = "the chip is another part, or too hot"
    return Finding.check("temperature", usual, what, remedy, {"temperature_c": celsius})


def noise_density(values: Vector, rate_hz: float, band_hz: tuple[float, float] = HIGH_HZ) -> Vector:
    """Return (3,) unit/sqrt(Hz): the root of the mean one-sided spectrum of `values` (n, 3) within `band_hz`."""
    n = len(values)
    window, hz = np.hanning(n + 1)[:-1], np.fft.rfftfreq(n, 1.0 / rate_hz)
    lines = np.fft.rfft((values - values.mean(0)) * window[:, None], axis=0)[(band_hz[0] <= hz) & (hz <= band_hz[1])]
    power = 2.0 * (lines.real**2 + lines.imag**2) / (rate_hz * np.sum(window**2))
    return np.asarray(np.sqrt(power.mean(0)))


def is_trembling(values: Vector, rate_hz: float) -> bool:
    """Return True if the board was moved: the noise alone is as dense in the lower band as in the higher."""
    return bool((noise_density(values, rate_hz, LOW_HZ) > LEAST_TREMOR_RATIO * noise_density(values, rate_hz)).any())


LONG_BYTES, SHORT_BYTES, READS = 55, 2, 25
SLOW_HZ = 300_000
# The difference of both reads at 1.6 MHz. A smaller one is no I2C bus's: these chips stop at 1 MHz.
LEAST_MS = 0.3
SLOW = "100 kHz is too slow for 1000 samples/s: `dtparam=i2c_arm_baudrate=400000` on a Raspberry Pi"


def examine_speed(bus: Bus) -> Iterator[Finding]:
    """Measure the speed of an I2C bus from the time of 53 bytes more, of nine bits each.

    Raises
    ------
    BusError : a transfer failed.
    """
    short_ms, long_ms = (median_ms(bus, count) for count in (SHORT_BYTES, LONG_BYTES))
    times_ms = {f"read_{SHORT_BYTES}_bytes_ms": short_ms, f"read_{LONG_BYTES}_bytes_ms": long_ms}
    if long_ms - short_ms < LEAST_MS:
        longer = max(long_ms - short_ms, 0.0)
        what = f"not measurable: {LONG_BYTES - SHORT_BYTES} bytes more take only {longer:.2f} ms, as behind USB"
        yield Finding("bus speed", Mark.UNKNOWN, what, "", times_ms)
        return
    hz = 9e3 * (LONG_BYTES - SHORT_BYTES) / (long_ms - short_ms)
    what = f"{hz / 1000:.0f} kHz measured; a read of 14 bytes takes {short_ms + 12 * 9e3 / hz:.2f} ms"
    yield Finding.check("bus speed", hz >= SLOW_HZ, what, SLOW, {"achieved_hz": hz, **times_ms})


def median_ms(bus: Bus, count: int) -> float:
    """Return the median time [ms] from one read of `count` bytes to the next; single reads may fail.

    Raises
    ------
    BusError : no two reads in a row succeed.
    """
    times: list[float] = []
    for _ in range(READS + 1):
        try:
            times.append(float(bus.read(reg.ACCEL_XOUT_H, count).t_ns))
        except BusError as error:
            times.append(np.nan)
            last = error
    steps = np.diff(times)
    if not np.isfinite(steps).any():
        raise last
    return float(np.nanmedian(steps)) / 1e6
