"""What the stream of a board at rest says about its chip: rate, losses, noise, gravity, zero rate, temperature."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..chip.clock import RATE_TOLERANCE
from ..chip.families import Family
from ..data import STANDARD_GRAVITY_MPS2, Recording
from .dead import dead_axes, live_axes
from .finding import Finding, Mark
from .noise import density, trembles

# times the data sheet's typical density
NOISY, BROKEN = 1.5, 3.0
# of the sample clock's rate; the least that a warming chip's does not do
CHANGED = 0.002
# five times what a quartz crystal may be off
OFF_PPM = 500.0
# +-3 % of scale and 80 mg of zero
FAR_FROM_G = 0.11
# what the stream may be short of: its first and last poll
ENDS_S = 0.1
USUAL_C = (-10.0, 70.0)


def examine_stream(recording: Recording, nominal_hz: float, seconds: float, family: Family | None) -> Iterator[Finding]:
    """Rate, losses, noise and what rest shows, of so many `seconds` of samples; None: its data sheet is not known."""
    if recording.sensor.clock_ppm is not None:
        yield _clock(recording.sensor.clock_ppm, float(recording.sensor.clock_std or np.nan))
    yield _rate(recording, nominal_hz)
    yield _losses(recording, seconds)
    acc, gyr = recording.acc, np.degrees(recording.gyr)
    hz = float(recording.sensor.rate_hz or nominal_hz)
    yield from dead_axes(recording)
    # what stands still has no noise, and rounding would be taken for a hand's
    acc_lives, gyr_lives = live_axes(recording)
    if acc_lives.any() and trembles(acc[:, acc_lives], hz):
        yield Finding("noise", Mark.UNKNOWN, "the board moved", "put it on a firm surface and try again")
        return
    if acc_lives.any() and family is not None:
        ug = density(acc[:, acc_lives], hz) / STANDARD_GRAVITY_MPS2 * 1e6
        yield _noise("accelerometer noise", ug, family.accel_noise_ug, "ug_rthz", "µg/√Hz")
    if gyr_lives.any() and family is not None:
        noise_dps = density(gyr[:, gyr_lives], hz)
        yield _noise("gyroscope noise", noise_dps, family.gyro_noise_dps, "dps_rthz", "deg/s/√Hz")
    if acc_lives.all():
        yield _gravity(recording)
    if family is not None:
        yield _zero_rate(gyr.mean(0).tolist(), family.zero_rate_dps)
    if np.isfinite(recording.temperature_c).any():
        yield _temperature(float(np.nanmean(recording.temperature_c)))


def _clock(ppm: float, std: float) -> Finding:
    what = f"{ppm:+.0f} ppm against this computer's (1 sigma {std * 1e6:.0f})"
    data = {"ppm": ppm, "std_ppm": std * 1e6}
    if std * 1e6 > OFF_PPM:
        return Finding(
            "bridge's clock", Mark.NOTE, what, "watch for longer (--seconds 30): its rate is not known yet", data
        )
    if abs(ppm) > OFF_PPM:
        return Finding("bridge's clock", Mark.NOTE, what, "nothing has to be done: times are corrected for that", data)
    return Finding("bridge's clock", Mark.OK, what, "", data)


def _rate(recording: Recording, nominal_hz: float) -> Finding:
    hz = float(recording.sensor.rate_hz or np.nan)
    off = hz / nominal_hz - 1
    # where a bridge's clock is hardly known, so is this
    ok = abs(off) <= RATE_TOLERANCE + 2.0 * (recording.sensor.clock_std or 0.0)
    what = f"{hz:.3f} Hz instead of {nominal_hz:g} Hz, {100 * off:+.2f} % (data sheet: within 1 %)"
    data = {"rate_hz": hz, "nominal_hz": nominal_hz}
    if ok and (change := _change(recording)) is not None:
        at_s, before_hz, after_hz = change
        what = f"the chip's clock changed after {at_s:.0f} s: from {before_hz:.3f} to {after_hz:.3f} Hz"
        remedy = "times follow it; if that happens again, check its supply, or replace the chip"
        return Finding("sample rate", Mark.NOTE, what, remedy, data)
    remedy = "" if ok else "the chip's clock is outside its specification: use the measured rate"
    return Finding("sample rate", Mark.OK if ok else Mark.BAD, what, remedy, data)


def _change(recording: Recording) -> tuple[float, float, float] | None:
    """Seconds, and the rates [Hz] before and after, of a sample clock that changed: its times lie on several lines."""
    period = np.where(recording.gap[1:], np.nan, np.diff(recording.t))
    if not np.nanmedian(np.abs(np.diff(period))) < CHANGED * np.nanmedian(period):
        # each sample has a time of its own: a driver of the kernel stamps it, or the channels are polled
        return None
    first, last = float(period[0]), float(period[-1])
    # NaN is no change
    if not abs(last / first - 1) > CHANGED:
        return None
    at = int(np.argmax(np.abs(period / first - 1) > abs(last / first - 1) / 2))
    return float(recording.t[at] - recording.t[0]), 1.0 / first, 1.0 / last


def _losses(recording: Recording, asked_s: float) -> Finding:
    gaps, seconds = int(recording.gap.sum()), float(recording.t[-1] - recording.t[0])
    data = {"samples": len(recording), "seconds": seconds, "gaps": gaps}
    what = f"{len(recording)} samples in {seconds:.1f} s"
    if not gaps and seconds > asked_s - ENDS_S:
        return Finding("losses", Mark.OK, f"none of {what}", "", data)
    remedy = "shorten the wires, check connectors and supply, or slow the bus down"
    gapped = f"{gaps} gap{'' if gaps == 1 else 's'} in {what}"
    return Finding("losses", Mark.BAD, f"{gapped}; {asked_s:g} s were expected", remedy, data)


def _noise(topic: str, measured: np.ndarray, typical: float, key: str, unit: str) -> Finding:
    share = float(measured.max()) / typical
    what = f"{', '.join(f'{value:.3g}' for value in measured)} {unit} (data sheet: {typical:g})"
    data = {key: measured.tolist(), f"typical_{key}": typical}
    if share <= NOISY:
        return Finding(topic, Mark.OK, what, "", data)
    remedy = "keep vibration away from the board and check its supply; if that does not help, the chip is noisy"
    return Finding(topic, Mark.NOTE if share <= BROKEN else Mark.BAD, what, remedy, data)


def _gravity(recording: Recording) -> Finding:
    g = float(np.linalg.norm(recording.acc.mean(0))) / STANDARD_GRAVITY_MPS2
    near = abs(g - 1) <= FAR_FROM_G
    remedy = (
        "" if near else "outside the data sheet's scale factor and bias; a calibration corrects it if it is constant"
    )
    return Finding("at rest", Mark.OK if near else Mark.NOTE, f"|a| is {g:.3f} g", remedy, {"g": g})


def _zero_rate(dps: list[float], limit_dps: float) -> Finding:
    inside = max(map(abs, dps)) <= limit_dps
    what = f"gyroscope bias {', '.join(f'{value:+.2f}' for value in dps)} deg/s (data sheet: within {limit_dps:g})"
    remedy = "" if inside else "a calibration corrects it if it is constant"
    return Finding("zero rate", Mark.OK if inside else Mark.NOTE, what, remedy, {"dps": dps})


def _temperature(celsius: float) -> Finding:
    usual = USUAL_C[0] < celsius < USUAL_C[1]
    what = f"{celsius:.1f} °C by the formula of this family"
    remedy = "" if usual else "the chip is another part, or too hot"
    return Finding("temperature", Mark.OK if usual else Mark.NOTE, what, remedy, {"temperature_c": celsius})
