"""noise.json: the noise of a sensor, from a long rest."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from ..arguments import read_limited
from ..data import Sensor, Vector
from ..disk.atomic import write_atomically
from ..errors import RecordingError
from ..strict_json import MOST_BYTES, parse_json
from .calibration import Calibration
from .document import plain

FORMAT = "mpucal.noise"
# its key in calibration.json
KEY = "noise"
ACCELEROMETER, GYROSCOPE = "accelerometer", "gyroscope"
WHITE, INSTABILITY, WALK, QUANTISATION = "white_noise", "bias_instability", "random_walk", "quantisation"
COEFFICIENTS = (WHITE, INSTABILITY, WALK, QUANTISATION)


@dataclass(frozen=True, eq=False, repr=False)
class Noise:  # noqa: PLW1641 - arrays have no hash either
    """Noise of six axes: accelerometer x, y, z [m/s^2], gyroscope x, y, z [rad/s].

    Attributes
    ----------
    values, low, high : each of COEFFICIENTS (6,), and its 95 % interval: white_noise N
        [units/sqrt(Hz), two-sided], bias_instability B [units], random_walk K [units/sqrt(s)], quantisation Q
        [units s]. NaN: not observable.
    tau_s : (k,) s. deviations : (k, 6) overlapping Allan deviation. clusters : (k,) number of tau in the rest.
    sensor, samples, seconds, rate_hz : of the rest. created : ISO 8601.
    data_sheet : white noise of the data sheet, by sensor [units/sqrt(Hz), two-sided]; empty: unknown chip.
    suspicious : observations, a code and a sentence each.
    course_s, course : (m,) s, (m, 7) slow means, the temperature last; not in the file.

    Noises with the same noise.json are equal.
    """

    values: Mapping[str, Vector]
    low: Mapping[str, Vector]
    high: Mapping[str, Vector]
    tau_s: Vector
    deviations: Vector
    clusters: Vector
    samples: int
    seconds: float
    rate_hz: float
    sensor: Sensor = field(default_factory=Sensor)
    created: str = ""
    data_sheet: Mapping[str, float] = field(default_factory=dict)
    suspicious: tuple[Mapping[str, str], ...] = ()
    course_s: Vector = field(default_factory=lambda: np.zeros(0))
    course: Vector = field(default_factory=lambda: np.zeros((0, 7)))

    def __eq__(self, other: object) -> bool:
        return self.document() == other.document() if isinstance(other, Noise) else NotImplemented

    def __repr__(self) -> str:
        white = f"{self.of(ACCELEROMETER, WHITE):.3g} m/s^2/sqrt(Hz), {self.of(GYROSCOPE, WHITE):.3g} rad/s/sqrt(Hz)"
        return f"<Noise of {self.sensor.chip or 'a sensor'}: white noise {white}; {self.seconds:.0f} s>"

    def of(self, sensor: str, coefficient: str) -> float:
        """Return the rms of a coefficient over a sensor's three axes; NaN if none is known."""
        values = self.values[coefficient][axes_of(sensor)]
        return float(np.sqrt(np.nanmean(values**2))) if np.isfinite(values).any() else math.nan

    def is_significant(self, sensor: str, coefficient: str) -> bool:
        """Return True if the coefficient is significantly non-zero on all three axes."""
        return bool(np.all(self.low[coefficient][axes_of(sensor)] > 0.0))

    def at_least(self, sensor: Sensor, rate_hz: float) -> Sensor:
        """Return the sensor with this white noise, of a sample at `rate_hz`, as its least noise."""
        acc, gyr = (self.of(name, WHITE) * math.sqrt(rate_hz) for name in (ACCELEROMETER, GYROSCOPE))
        least_acc, least_gyr = sensor.least_noise
        return replace(sensor, least_noise=(max(acc, least_acc), max(gyr, least_gyr)))

    def document(self) -> dict[str, Any]:
        """Return the content of noise.json in JSON types; NaN becomes None."""

        def of(sensor: str) -> dict[str, Any]:
            part = axes_of(sensor)
            ends = {"value": self.values, "low": self.low, "high": self.high}
            found = {name: {end: of_all[name][part] for end, of_all in ends.items()} for name in COEFFICIENTS}
            data_sheet = {"data_sheet": {WHITE: self.data_sheet[sensor]}} if sensor in self.data_sheet else {}
            return {**found, "allan_deviation": self.deviations[:, part], **data_sheet}

        document = {
            "format": FORMAT,
            "version": 1,
            "created": self.created,
            "sensor": {key: value for key, value in vars(self.sensor).items() if value is not None},
            "rate_hz": self.rate_hz,
            "samples": self.samples,
            "seconds": self.seconds,
            "tau_s": self.tau_s,
            "clusters": self.clusters,
            ACCELEROMETER: of(ACCELEROMETER),
            GYROSCOPE: of(GYROSCOPE),
            "suspicious": self.suspicious,
        }
        return {key: plain(value) for key, value in document.items()}

    def json(self) -> str:
        """Return the document as text."""
        return json.dumps(self.document(), indent=2, allow_nan=False) + "\n"

    def save(self, path: str | Path) -> None:
        """Write noise.json, atomically.

        Raises
        ------
        OutputError : it cannot be written.
        """
        write_atomically(Path(path), self.json().encode())

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a noise.json.

        Raises
        ------
        RecordingError : there is no such file, or no noise in it.
        """
        try:
            return cls._of(parse_json(read_limited(Path(path), MOST_BYTES)))
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            what = f"{path} holds no noise ({type(error).__name__}: {error})"
            raise RecordingError(what, "give a noise.json, as `mpucal noise -o DIR` writes it") from error

    @classmethod
    def _of(cls, document: Mapping[str, Any]) -> Self:
        if document.get("format") != FORMAT:
            raise ValueError(f'"format" is {document.get("format")!r}, not {FORMAT!r}')
        both = document[ACCELEROMETER], document[GYROSCOPE]

        def of(end: str) -> dict[str, Vector]:
            return {name: np.array([*both[0][name][end], *both[1][name][end]], float) for name in COEFFICIENTS}

        return cls(
            of("value"),
            of("low"),
            of("high"),
            np.array(document["tau_s"], float),
            np.hstack([np.array(one["allan_deviation"], float).reshape(-1, 3) for one in both]),
            np.array(document["clusters"], float),
            int(document["samples"]),
            float(document["seconds"]),
            float(document["rate_hz"]),
            Sensor.of(document.get("sensor", {})),
            str(document.get("created", "")),
            {
                name: one["data_sheet"][WHITE]
                for name, one in zip((ACCELEROMETER, GYROSCOPE), both, strict=True)
                if "data_sheet" in one
            },
            tuple(document.get("suspicious", ())),
        )


def with_noise(calibration: Calibration, noise: Noise) -> Calibration:
    """Return the calibration with its sensor's noise in `extra["noise"]`, as the rms over three axes.

    A coefficient that is not significant is replaced by the upper end of its interval, and listed in `at_most`.
    """
    entry: dict[str, Any] = {"created": noise.created, "seconds": noise.seconds, "rate_hz": noise.rate_hz}
    for sensor in (ACCELEROMETER, GYROSCOPE):
        part, of = axes_of(sensor), {}
        unsure = [name for name in (WHITE, INSTABILITY, WALK) if not noise.is_significant(sensor, name)]
        for name in (WHITE, INSTABILITY, WALK):
            values = (noise.high if name in unsure else noise.values)[name][part]
            of[name] = float(np.sqrt(np.mean(values**2)))
        entry[sensor] = {**of, "at_most": unsure}
    return replace(calibration, extra={**calibration.extra, KEY: entry})


def axes_of(sensor: str) -> slice:
    """Return the place of a sensor among the six axes."""
    return slice(0, 3) if sensor == ACCELEROMETER else slice(3, 6)
