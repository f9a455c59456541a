"""The noise of a sensor at rest, by its Allan variance, from a stream of samples in constant memory."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from ..chip.families import part_named
from ..data import RUN, STANDARD_GRAVITY_MPS2, Recording, Samples, Sensor, Vector
from ..errors import RecordingError
from ..origin import name_thing
from ..result.comparison import TOLD_APART_C
from ..result.noise import ACCELEROMETER, COEFFICIENTS, GYROSCOPE, INSTABILITY, WHITE, Noise
from .model import fit_coefficients
from .trace import Octaves, Spectrum, Trace, find_steps, find_turn

__all__ = ["NoiseMeter", "noise_of"]

AXES = tuple(f"{sensor} {axis}" for sensor in (ACCELEROMETER, GYROSCOPE) for axis in "xyz")
UNITS = tuple(unit for unit in ("m/s²", "rad/s") for _ in "xyz")
LEAST_SAMPLES = 256
# correlation of an axis with a change of temperature that is reported
CORRELATED = 0.7
# rms over the white noise of a sample: a weaker tone is hidden
LEAST_TONE = 0.05


class NoiseMeter:
    """Accumulator of samples at rest; `result` can be called at any time.

    Parameters
    ----------
    rate_hz : sample rate; None: from the times of the first samples.
    """

    def __init__(self, sensor: Sensor, rate_hz: float | None = None) -> None:
        self._sensor, self._rate_hz = sensor, rate_hz
        self._octaves, self._spectrum = Octaves(6), Spectrum(6)
        self._trace: Trace | None = None
        self._first_s = self._last_s = self._gaps_s = 0.0

    @property
    def seconds(self) -> float:
        """Return the duration without gaps [s]."""
        return self._last_s - self._first_s - self._gaps_s

    def add(self, samples: Samples) -> None:
        """Add samples; a gap interrupts the statistics."""
        if not len(samples):
            return
        if self._rate_hz is None and len(samples) > 1:
            self._rate_hz = float(1.0 / np.median(np.diff(samples.t)))
        if self._trace is None:
            self._trace = Trace(7, self._rate_hz or 200.0)
            self._first_s = self._last_s = float(samples.t[0])
        cuts = [0, *np.flatnonzero(samples.gap).tolist(), len(samples)]
        for a, b in pairwise(cuts):
            if a == b:
                continue
            follows = not samples.gap[a]
            # by axis, so that the sums over time run along memory
            columns = np.vstack([samples.acc[a:b].T, samples.gyr[a:b].T, samples.temperature_c[a:b]])
            values = columns[:6]
            if not np.isfinite(values).all():
                raise RecordingError(
                    "the recording was read without rates",
                    "say how to read it: --rate HZ, --units gyr=UNIT or --gyro-range DPS",
                )
            self._octaves.add(values, follows)
            self._spectrum.add(values, follows)
            self._trace.add(columns)
            self._gaps_s += 0.0 if follows else float(samples.t[a]) - self._last_s
            self._last_s = float(samples.t[b - 1])

    def result(self, created: str = "") -> Noise:
        """Return the noise so far.

        Raises
        ------
        RecordingError : there are too few samples.
        """
        n = self._octaves.samples
        if n < LEAST_SAMPLES or self._trace is None or self.seconds <= 0.0:
            raise RecordingError(
                f"{n} samples are too few to measure noise", "let the board rest for minutes, or hours"
            )
        rate_hz = (n - 1) / self.seconds
        sizes, variances, _ = self._octaves.variances()
        fits = [fit_coefficients(sizes, variances[:, axis], n, 1.0 / rate_hz) for axis in range(6)]
        values, low, high = (
            {
                name: np.array([math.nan if one is None else getattr(one, end)[i] for one in fits])
                for i, name in enumerate(COEFFICIENTS)
            }
            for end in ("value", "low", "high")
        )
        course = self._trace.means
        return Noise(
            values,
            low,
            high,
            sizes / rate_hz,
            np.sqrt(variances),
            n / sizes,
            n,
            self.seconds,
            rate_hz,
            self._sensor,
            created,
            data_sheet(self._sensor),
            tuple(self._suspicious(values[WHITE], course, rate_hz)),
            np.asarray(self._trace.seconds * (np.arange(len(course)) + 0.5)),
            course,
        )

    def needed_s(self, wanted: float) -> float | None:
        """Return the time [s] until bias instability is known to a relative uncertainty `wanted`; None if unknown.

        The uncertainty (1 sigma) decreases with the square root of time.
        """
        try:
            noise = self.result()
        except RecordingError:
            return None
        value, high = noise.values[INSTABILITY], noise.high[INSTABILITY]
        share = float(np.nanmax((high - value) / np.where(value > 0.0, value, np.nan) / 1.96, initial=-1.0))
        return None if share < 0.0 else max(self.seconds * ((share / wanted) ** 2 - 1.0), 0.0)

    def _suspicious(self, white: Vector, course: Vector, rate_hz: float) -> list[dict[str, str]]:
        seconds = self._trace.seconds if self._trace is not None else 0.0
        turn = find_turn(course[:, :6]) if len(course) else None
        if turn is not None:
            block, angle = turn
            what = f"the board was turned, gravity by {math.degrees(angle):.0f} deg, from {block * seconds:.0f} s on"
            message = name_thing(f"{what}: these numbers are of the motion, not of the sensor", self._sensor.origin)
            return [{"code": "moved", "message": message}]
        found = []
        for tone in self._spectrum.tones(rate_hz):
            if tone.rms > LEAST_TONE * white[tone.axis] * math.sqrt(rate_hz):
                what = (
                    f"{AXES[tone.axis]}: a tone at {tone.frequency_hz:.2f} Hz of {tone.rms:.2g} {UNITS[tone.axis]} rms"
                )
                found.append({"code": "tone", "message": f"{what}, as from a fan or a pump"})
        for block, axis, size in find_steps(course[:, :6]):
            what = f"{AXES[axis]}: a step of {size:+.2g} {UNITS[axis]} after {block * seconds:.0f} s"
            moved = name_thing("the board was moved, or its bias jumped", self._sensor.origin)
            found.append({"code": "step", "message": f"{what}: {moved}"})
        T = course[:, 6]
        if np.isfinite(T).sum() > 8 and np.nanmax(T) - np.nanmin(T) > TOLD_APART_C:
            found.append({"code": "temperature", "message": _temperature_sentence(course[np.isfinite(T)])})
        return found


def noise_of(recording: Recording, created: str = "") -> Noise:
    """Return the noise in a recording of a sensor at rest.

    Raises
    ------
    RecordingError : there are too few samples.
    """
    meter = NoiseMeter(recording.sensor, recording.rate_hz if len(recording) > 1 else None)
    for first in range(0, len(recording), RUN):
        meter.add(recording.part(first, first + RUN))
    return meter.result(created)


def data_sheet(sensor: Sensor) -> dict[str, float]:
    """Return the typical white noise of the chip by its data sheet, two-sided; empty if the chip is not known."""
    part = part_named(sensor.chip)
    if part is None:
        return {}
    # a data sheet's densities are one-sided
    return {
        ACCELEROMETER: part.family.accel_noise_ug * 1e-6 * STANDARD_GRAVITY_MPS2 / math.sqrt(2.0),
        GYROSCOPE: math.radians(part.family.gyro_noise_dps) / math.sqrt(2.0),
    }


def _temperature_sentence(course: Vector) -> str:
    """Return a sentence on the change of temperature and the axes that are correlated with it."""
    T = course[:, 6]
    r = np.asarray(np.corrcoef(course, rowvar=False))[6, :6]
    moved = [f"{AXES[i]} ({r[i]:+.2f})" for i in range(6) if abs(r[i]) > CORRELATED]
    what = f"the temperature changed by {T.max() - T.min():.1f} °C"
    return f"{what}, and with it {', '.join(moved)}" if moved else what
