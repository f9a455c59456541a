"""Which IIO devices hold a board's accelerometer and gyroscope: one for both, or one each."""

from __future__ import annotations

import re
from typing import NamedTuple

DEVICE = re.compile(r"(?:iio:)?(?:device)?(\d+)")


class Devices(NamedTuple):
    """The devices of the two sensors, as iio:device0."""

    accel: str
    gyro: str

    @property
    def each(self) -> tuple[str, ...]:
        """Each once."""
        return tuple(dict.fromkeys(self))

    @classmethod
    def parse(cls, text: str) -> Devices:
        """Of iio:device0, or accel=iio:device0,gyro=iio:device1; `iio:` and `device` may be left out.

        Raises
        ------
        ValueError : no such text, with a sentence.
        """
        parts = dict(part.partition("=")[::2] for part in text.split(","))
        if set(parts) == {"accel", "gyro"}:
            return cls(_device(parts["accel"]), _device(parts["gyro"]))
        return cls(_device(text), _device(text))


def _device(text: str) -> str:
    found = DEVICE.fullmatch(text.strip())
    if found is None:
        raise ValueError(f"{text!r} is no device: give iio:deviceN, or accel=iio:deviceN,gyro=iio:deviceM.")
    return f"iio:device{found.group(1)}"
