"""Tones in noise, from a power spectral density averaged over segments (Welch, 1967), in constant memory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import Vector

SEGMENT = 4096
# a line's least height above its neighbours, beyond the limit of chance, and the probability of that limit
LEAST_SHARE, SURPRISE = 0.3, 1e-4
# bins: half widths of the neighbourhoods and of a line; lines per axis
NEIGHBOURS, LINE, AT_MOST = (8, 32), 2, 1


@dataclass(frozen=True)
class Tone:
    """Line of a spectrum: axis number, frequency [Hz], rms in the samples' units."""

    axis: int
    frequency_hz: float
    rms: float


class Spectrum:
    """Mean density of several axes so far."""

    def __init__(self, axes: int) -> None:
        self._window = np.hanning(SEGMENT)
        self._held = np.zeros((0, axes))
        self._power = np.zeros((SEGMENT // 2 + 1, axes))
        self._segments = 0

    def add(self, values: Vector, follows: bool = True) -> None:
        """Add (n, axes) samples; `follows` is False after a gap."""
        self._held = np.concatenate([self._held, values]) if follows else values
        while len(self._held) >= SEGMENT:
            part, self._held = self._held[:SEGMENT], self._held[SEGMENT:]
            windowed = (part - part.mean(0)) * self._window[:, None]
            self._power += np.abs(np.fft.rfft(windowed, axis=0)) ** 2
            self._segments += 1

    def tones(self, rate_hz: float) -> list[Tone]:
        """Return the significant lines, the strongest of each axis first."""
        from scipy.ndimage import median_filter  # noqa: PLC0415 - slow to import
        from scipy.stats import chi2  # noqa: PLC0415

        if not self._segments:
            return []
        density = 2.0 * self._power / (self._segments * rate_hz * np.sum(self._window**2))
        freedom = 2 * self._segments
        # relative to the median, as the floor is a median of the neighbours
        most = float(chi2.isf(SURPRISE / len(density), freedom) / chi2.median(freedom))
        found: list[Tone] = []
        for axis, of in enumerate(density.T):
            # the narrow neighbourhood follows a steep density, such as drift at low frequencies
            floor = np.maximum(*(median_filter(of, 2 * many + 1, mode="reflect") for many in NEIGHBOURS)) + 1e-300
            above = of / floor
            # the lowest bins are drift, and the highest lack neighbours
            above[: 2 * LINE] = above[-2 * LINE :] = 0.0
            lines: list[Tone] = []
            while len(lines) < AT_MOST and (at := int(above.argmax())) and above[at] > (1.0 + LEAST_SHARE) * most:
                around = slice(max(at - LINE, 0), at + LINE + 1)
                power = float(np.sum(of[around] - floor[around])) * rate_hz / SEGMENT
                lines.append(Tone(axis, at * rate_hz / SEGMENT, float(np.sqrt(max(power, 0.0)))))
                above[around] = 0.0
            found += lines
        return found
