"""Names of the IIO devices of a board's accelerometer and gyroscope: one for both, or one each."""

from __future__ import annotations

import re
from typing import NamedTuple

from ..errors import UsageError

DEVICE = re.compile(r"(?:iio:)?(?:device)?(\d+)")


class Devices(NamedTuple):
    """Devices of the two sensors, such as iio:device0."""

    accel: str
    gyro: str

    @property
    def each(self) -> tuple[str, ...]:
        """Devices without duplicates."""
        return tuple(dict.fromkeys(self))

    @classmethod
    def parse(cls, text: str) -> Devices:
        """Parse iio:device0, or accel=iio:device0,gyro=iio:device1; `iio:` and `device` may be left out.

        Raises
        ------
        UsageError : another text.
        """
        parts = dict(part.partition("=")[::2] for part in text.split(","))
        if set(parts) == {"accel", "gyro"}:
            return cls(_device(parts["accel"]), _device(parts["gyro"]))
        return cls(_device(text), _device(text))


def _device(text: str) -> str:
    found = DEVICE.fullmatch(text.strip())
    if found is None:
        raise UsageError(f"--iio: {text!r} is not a device", "give iio:deviceN, or accel=iio:deviceN,gyro=iio:deviceM")
    return f"iio:device{found.group(1)}"
