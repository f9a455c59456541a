"""Tones in noise that lasts: power spectral density averaged over segments (Welch, 1967), in constant memory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import Vector

SEGMENT = 4096
# so much a line stands above its neighbours, beyond chance
LEAST_SHARE, SURPRISE = 0.3, 1e-4
NEIGHBOURS, LINE, AT_MOST = (8, 32), 2, 1


@dataclass(frozen=True)
class Tone:
    """A line of a spectrum: axis number, frequency [Hz], rms in the samples' units."""

    axis: int
    frequency_hz: float
    rms: float


class Spectrum:
    """The mean density of several axes so far."""

    def __init__(self, axes: int) -> None:
        self._window = np.hanning(SEGMENT)
        self._held = np.zeros((0, axes))
        self._power = np.zeros((SEGMENT // 2 + 1, axes))
        self._segments = 0

    def add(self, values: Vector, follows: bool = True) -> None:
        """Add (n, axes) samples; `follows`: none is missing between them and those before."""
        self._held = np.concatenate([self._held, values]) if follows else values
        while len(self._held) >= SEGMENT:
            part, self._held = self._held[:SEGMENT], self._held[SEGMENT:]
            windowed = (part - part.mean(0)) * self._window[:, None]
            self._power += np.abs(np.fft.rfft(windowed, axis=0)) ** 2
            self._segments += 1

    def tones(self, rate_hz: float) -> list[Tone]:
        """The lines that no noise makes, the strongest of each axis first."""
        from scipy.ndimage import median_filter  # noqa: PLC0415 - slow to import
        from scipy.stats import chi2  # noqa: PLC0415

        if not self._segments:
            return []
        density = 2.0 * self._power / (self._segments * rate_hz * np.sum(self._window**2))
        freedom = 2 * self._segments
        # both over the median, by which the neighbours are told
        most = float(chi2.isf(SURPRISE / len(density), freedom) / chi2.median(freedom))
        found: list[Tone] = []
        for axis, of in enumerate(density.T):
            # the near ones where the density is steep, as that of drift at low frequencies
            floor = np.maximum(*(median_filter(of, 2 * many + 1, mode="reflect") for many in NEIGHBOURS)) + 1e-300
            above = of / floor
            # the lowest bins are drift, and at the last the filter that folds has no neighbours
            above[: 2 * LINE] = above[-2 * LINE :] = 0.0
            lines: list[Tone] = []
            while len(lines) < AT_MOST and (at := int(above.argmax())) and above[at] > (1.0 + LEAST_SHARE) * most:
                around = slice(max(at - LINE, 0), at + LINE + 1)
                power = float(np.sum(of[around] - floor[around])) * rate_hz / SEGMENT
                lines.append(Tone(axis, at * rate_hz / SEGMENT, float(np.sqrt(max(power, 0.0)))))
                above[around] = 0.0
            found += lines
        return found
