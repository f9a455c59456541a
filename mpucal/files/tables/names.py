"""Columns by their names: quantity, axis and unit, as loggers, data sets and sketches spell them.

Each known stem is one of a program: EuRoC's w_RS_S_x, Kalibr's omega_x and alpha_x, ROS's angular_velocity.x,
phyphox's "Gyroscope x (rad/s)", AndroSensor's "ACCELEROMETER X (m/s²)", SensorLog's gyroRotationX(rad/s), Physics
Toolbox's gFx and wx, ulog2csv's accelerometer_m_s2[0], Betaflight's gyroADC[0], sketches' ax, AcX and gyroX.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from ...data import Vector
from .units import COUNTS, QUANTITIES, unit_named

TIME, NANOSECONDS, ACC, GYR, TEMPERATURE = "t", "nanoseconds", "acc", "gyr", "temperature_c"
# stem -> the unit that its program writes, empty where that differs; the first known is taken where there are several
ACC_STEMS = {
    "accelerometeruncalibrated": "",
    "accelerometeracceleration": "g",
    "accelerometer": "",
    "totalacceleration": "",
    "acceleration": "",
    "accel": "",
    "accl": "",
    "acce": "",
    "acc": "",
    "accs": "",
    "ac": "",
    "a": "",
    "arss": "m/s^2",
    "alpha": "m/s^2",
    "gf": "g",
    "accsmooth": "",
    "linearacceleration": "",
}
GYR_STEMS = {
    "gyroscopeuncalibrated": "rad/s",
    "gyroscope": "",
    "gyrorotation": "",
    "gyro": "",
    "gyr": "",
    "gy": "",
    "g": "",
    "as": "",
    "wrss": "rad/s",
    "omega": "rad/s",
    "w": "rad/s",
    "angularvelocity": "rad/s",
    "angularrate": "",
    "gyroadc": "deg/s",
    "rotationrate": "",
    "motionrotationrate": "",
    "rotation": "",
}
TIME_STEMS = {
    "headerstamp": "ns",
    "stamp": "",
    "epoch": "",
    "timestampsample": "us",
    "timestamp": "",
    "timestamps": "",
    "time": "",
    "times": "",
    "t": "",
    "ts": "",
    "timesincestart": "",
    "timesincestartin": "",
    "secondselapsed": "s",
    "elapsed": "",
    "elapsedtime": "",
    "seconds": "s",
    "sec": "s",
    "millis": "ms",
    "micros": "us",
    "rtctime": "",
    "datetime": "",
    "date": "",
    "secs": "s",
    "headerstampsec": "s",
    "headerstampsecs": "s",
    "stampsec": "s",
    "stampsecs": "s",
    "sampletimefine": "0.1ms",
}
# beside whole seconds: builtin_interfaces/Time, and ROS 1's time
NANOSECOND_STEMS = tuple(f"{of}{word}" for of in ("", "stamp", "headerstamp") for word in ("nanosec", "nsecs", "nsec"))
# each sensor's own clock: SensorLog
OWN_TIMES = {"accelerometertimestampsincereboot": ACC, "gyrotimestampsincereboot": GYR}
TEMPERATURE_STEMS = tuple(
    f"{word}{unit}" for word in ("temperature", "temp", "imutemp") for unit in ("", "c", "celsius", "degc")
)
COLDEST_C, WARMEST_C = -60.0, 130.0
# iOS counts the acceleration of gravity as a body's own: at rest it reads -1 g along what points upwards
TURNED_AROUND = ("accelerometeracceleration",)
_OF_TIME = ("", *QUANTITIES[TIME])
_PREFIXES = ("field", "imu0", "imu1", "imu", "sensors", "sensor", "raw", "data", "phone", "body")
_AXIS = re.compile(r"([xyz])(?:[-_ ]?(?:axis|value))?\s*(?:[\[(](.*)[\])])?")
_BRACKETS = re.compile(r"(.*?)[\s_.]*[\[(]\s*([^\[\]()]*?)\s*[\])]\s*")
_UNIT_TAIL = re.compile(
    r"(.*?[a-z\]0-9])[_ ](ns|us|ms|s|sec|seconds|g|gs|mg|dps|mdps|mps2|m_s2|m/s2|ms2|rad_s|rads|rad|deg_s|degs|deg"
    r"|deg_per_s|rad_per_s)"
)


@dataclass(frozen=True)
class Column:
    """What a column holds: of `quantity` the axis 0, 1, 2; `rank` orders those of the same.

    `unit` is the one that its name says, or its program's; `of` the quantity whose time it is, empty of both.
    """

    name: str
    place: int
    quantity: str
    axis: int = 0
    unit: str = ""
    rank: int = 0
    of: str = ""
    turned_around: bool = False


def column_named(name: str, place: int) -> Column | None:
    """What the column of that name, at `place` from 0, holds; None of what is not read."""
    text, axis, unit = name.strip().lstrip("#%").strip(), -1, ""
    while match := _BRACKETS.fullmatch(text):
        text, inside = match.groups()
        if inside in ("0", "1", "2"):
            axis = int(inside)
        elif inside.lower().replace("°", "").removeprefix("deg ").strip() in ("c", "degc", "celsius", "℃"):
            unit = "C"
        elif not (unit := unit_named(inside)):
            return None
    return _stem(name, place, text.lower(), axis, unit)


def _stem(name: str, place: int, text: str, axis: int, unit: str) -> Column | None:
    found = _known(name, place, text, axis, unit)
    if found is None and not unit and (tail := _UNIT_TAIL.fullmatch(text)):
        found = _known(name, place, tail[1], axis, unit_named(tail[2]))
    return found


def _known(name: str, place: int, text: str, axis: int, unit: str) -> Column | None:
    compact = re.sub(r"[^a-z0-9]", "", text)
    for word in (compact, *_without_prefixes(compact)):
        if word in OWN_TIMES and unit in _OF_TIME:
            return Column(name, place, TIME, unit=unit or "s", of=OWN_TIMES[word])
        if word in NANOSECOND_STEMS and not unit:
            return Column(name, place, NANOSECONDS)
        if word in TIME_STEMS and axis < 0 and unit in _OF_TIME:
            return Column(name, place, TIME, unit=unit or TIME_STEMS[word], rank=list(TIME_STEMS).index(word))
        if (word in TEMPERATURE_STEMS and unit in ("", "C")) or (word == "t" and unit == "C"):
            return Column(name, place, TEMPERATURE)
        for of, stems in ((ACC, ACC_STEMS), (GYR, GYR_STEMS)):
            for stem, at in _axes(word, axis):
                if stem in stems and unit in ("", *QUANTITIES[of]):
                    rank, around = list(stems).index(stem), stem in TURNED_AROUND
                    return Column(name, place, of, at, unit or stems[stem], rank, turned_around=around)
    return None


def _without_prefixes(word: str) -> list[str]:
    found = []
    for prefix in _PREFIXES:
        if word.startswith(prefix) and len(word) > len(prefix):
            word = word.removeprefix(prefix)
            found.append(word)
    return found


def _axes(word: str, axis: int) -> list[tuple[str, int]]:
    """(stem, axis) that a word may be made of: ax, gyroX, xacc."""
    if axis >= 0:
        return [(word, axis)]
    found = []
    if word[-1:] in ("x", "y", "z"):
        found.append((word[:-1], "xyz".index(word[-1])))
    for raw in ("raw", "adc", "lsb", "counts"):
        if word.endswith(raw) and word.removesuffix(raw)[-1:] in ("x", "y", "z"):
            found.append((word.removesuffix(raw)[:-1], "xyz".index(word.removesuffix(raw)[-1])))
    if word[:1] in ("x", "y", "z"):
        found.append((word[1:], "xyz".index(word[0])))
    return found


def bare_axis(name: str) -> tuple[int, str] | None:
    """(axis, unit) of a column that is called x, y, z, `x-axis (g)` and the like; None of another."""
    found = _AXIS.fullmatch(name.strip().lower())
    return ("xyz".index(found[1]), unit_named(found[2] or "")) if found else None


def columns_of(header: list[str]) -> list[Column]:
    """What the columns of a header hold, those that are known."""
    return [column for place, name in enumerate(header) if (column := column_named(name, place)) is not None]


def threes(columns: list[Column], quantity: str) -> list[tuple[Column, ...]]:
    """x, y, z of a quantity, of each stem that has all of them, by rank."""
    of = [column for column in columns if column.quantity == quantity]
    ranks = sorted({column.rank for column in of})
    found = [sorted((c for c in of if c.rank == rank), key=lambda c: c.axis) for rank in ranks]
    return [tuple(axes) for axes in found if [c.axis for c in axes] == [0, 1, 2]]


def three(columns: list[Column], quantity: str) -> tuple[Column, ...]:
    """The first of threes; empty where there are none."""
    return next(iter(threes(columns, quantity)), ())


def celsius(values: Vector) -> Vector | None:
    """Temperatures (n,); None of what no sensor has: counts, or Kelvin."""
    known = values[np.isfinite(values)]
    return values if len(known) and known.min() > COLDEST_C and known.max() < WARMEST_C else None


__all__ = [
    "ACC",
    "COUNTS",
    "GYR",
    "NANOSECONDS",
    "TEMPERATURE",
    "TIME",
    "Column",
    "celsius",
    "column_named",
    "columns_of",
    "three",
    "threes",
]
