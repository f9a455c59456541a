"""Columns by their names: quantity, axis and unit, as loggers, data sets and sketches spell them.

Each known stem is one of a program: EuRoC's w_RS_S_x, Kalibr's omega_x and alpha_x, ROS's angular_velocity.x,
phyphox's "Gyroscope x (rad/s)", AndroSensor's "ACCELEROMETER X (m/s²)", SensorLog's gyroRotationX(rad/s), Physics
Toolbox's gFx and wx, ulog2csv's accelerometer_m_s2[0], Betaflight's gyroADC[0], sketches' ax, AcX and gyroX.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from .units import COUNTS, unit_named

TIME, ACC, GYR, TEMPERATURE = "t", "acc", "gyr", "temperature_c"
# stem -> the unit that its program writes, empty where that differs; the first known is taken where there are several
ACC_STEMS = {
    "accelerometeruncalibrated": "",
    "accelerometeracceleration": "g",
    "accelerometer": "",
    "totalacceleration": "",
    "acceleration": "",
    "accel": "",
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
    "wrss": "rad/s",
    "omega": "rad/s",
    "w": "rad/s",
    "angularvelocity": "rad/s",
    "angularrate": "",
    "gyroadc": "deg/s",
    "rotationrate": "",
    "motionrotationrate": "",
}
TIME_STEMS = {
    "headerstamp": "ns",
    "stamp": "",
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
}
# each sensor's own clock: SensorLog
OWN_TIMES = {"accelerometertimestampsincereboot": ACC, "gyrotimestampsincereboot": GYR}
TEMPERATURE_STEMS = ("temperature", "temp")
# iOS counts the acceleration of gravity as a body's own: at rest it reads -1 g along what points upwards
TURNED_AROUND = ("accelerometeracceleration",)
_PREFIXES = ("field", "imu0", "imu1", "imu", "sensors", "sensor", "raw", "data", "phone", "body")
_BRACKETS = re.compile(r"(.*?)[\s_.]*[\[(]\s*([^\[\]()]*?)\s*[\])]\s*")
_UNIT_TAIL = re.compile(
    r"(.*?[a-z\]0-9])[_ ](ns|us|ms|s|sec|g|mg|dps|mdps|mps2|m_s2|m/s2|ms2|rad_s|rads|rad|deg_s|degs|deg)"
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
        elif inside.lower().replace("°", "").removeprefix("deg ").strip() in ("c", "degc", "celsius"):
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
        if word in OWN_TIMES:
            return Column(name, place, TIME, unit=unit or "s", of=OWN_TIMES[word])
        if word in TIME_STEMS and axis < 0:
            return Column(name, place, TIME, unit=unit or TIME_STEMS[word], rank=list(TIME_STEMS).index(word))
        if (word in TEMPERATURE_STEMS and unit == "C") or word == "temperaturec":
            return Column(name, place, TEMPERATURE)
        for of, stems in ((ACC, ACC_STEMS), (GYR, GYR_STEMS)):
            for stem, at in _axes(word, axis):
                if stem in stems:
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


def columns_of(header: list[str]) -> list[Column]:
    """What the columns of a header hold, those that are known."""
    return [column for place, name in enumerate(header) if (column := column_named(name, place)) is not None]


def three(columns: list[Column], quantity: str) -> tuple[Column, ...]:
    """x, y, z of a quantity, of the first stem that has all of them; empty where none has."""
    of = [column for column in columns if column.quantity == quantity]
    for rank in sorted({column.rank for column in of}):
        found = [column for column in of if column.rank == rank]
        axes = tuple(next((c for c in found if c.axis == axis), None) for axis in range(3))
        if None not in axes and len(found) == 3:
            return tuple(c for c in axes if c is not None)
    return ()


__all__ = ["ACC", "COUNTS", "GYR", "TEMPERATURE", "TIME", "Column", "column_named", "columns_of", "three"]
