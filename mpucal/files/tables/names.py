"""Columns by their names: quantity, axis and unit, as loggers, data sets and sketches spell them.

Each known stem is one of a program: EuRoC's w_RS_S_x, Kalibr's omega_x and alpha_x, ROS's angular_velocity.x,
phyphox's "Gyroscope x (rad/s)", AndroSensor's "ACCELEROMETER X (m/s²)", SensorLog's gyroRotationX(rad/s), Physics
Toolbox's gFx and wx, ulog2csv's accelerometer_m_s2[0], Betaflight's gyroADC[0], sketches' ax, AcX and gyroX.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import groupby

import numpy as np

from ...data import Vector
from .units import PER_SAMPLE, QUANTITIES, find_unit

TIME, NANOSECONDS, ACC, GYR, TEMPERATURE = "t", "nanoseconds", "acc", "gyr", "temperature_c"


def _stems(words: str) -> dict[str, str]:
    """Return stem -> unit of words "stem" or "stem:unit", in the order of preference."""
    return {stem: unit for stem, _, unit in (word.partition(":") for word in words.split())}


# increments over a sample
_OF_VELOCITY = "deltavelocity deltavel deltav delv dvel dv velinc"
_OF_ANGLE = "deltaangle deltatheta dela dangle dang dtheta dth"
INCREMENTS = {*_OF_VELOCITY.split(), *_OF_ANGLE.split()}
# times since the sample before
INTERVALS = "dt deltat deltatime deltams deltaus timedelta timediff interval"
# a unit stands only where the program that uses the stem always writes that one
STEMS = {
    TIME: _stems(
        "headerstamp:ns stamp epoch timestampsample:us timestamp timestamps time times t ts timesincestart"
        " timesincestartin secondselapsed:s elapsed elapsedtime seconds:s sec:s millis:ms micros:us rtctime datetime"
        " date secs:s headerstampsec:s headerstampsecs:s stampsec:s stampsecs:s timestampsec:s sampletimefine"
        f" accelerometertimestampsincereboot:s gyrotimestampsincereboot:s {INTERVALS}"
    ),
    # the part below a second, in a column beside whole seconds: builtin_interfaces/Time, and ROS 1's time
    NANOSECONDS: _stems(
        "nanosec nsecs nsec stampnanosec stampnsecs stampnsec headerstampnanosec headerstampnsecs headerstampnsec"
        " timestampnanosec timestampnsecs timestampnsec"
    ),
    TEMPERATURE: _stems(
        "temperature temp imutemp temperaturec tempc imutempc temperaturecelsius tempcelsius imutempcelsius"
        " temperaturedegc tempdegc imutempdegc t"
    ),
    ACC: _stems(
        "accelerometeruncalibrated accelerometeracceleration:g accelerometer totalacceleration acceleration accel accl"
        " acce accelero acc accs accuncal ac a arss:m/s^2 alpha:m/s^2 gf:g gforce:g accsmooth linearacceleration"
        " specificforce acel aceleracao aceleracion acelerometro accelerazione accelerometro beschleunigung"
        f" {_OF_VELOCITY}"
    ),
    GYR: _stems(
        "gyroscopeuncalibrated:rad/s gyroscope gyrorotation gyro gyr gy g as wrss:rad/s omega:rad/s w"
        " angularvelocity:rad/s angvel angveluncal gyrouncal angularrate angrate gyroadc:deg/s rotationrate"
        " motionrotationrate rotation angular giro giroscopio giroscopo drehrate"
        f" {_OF_ANGLE}"
    ),
}
UNITS = {NANOSECONDS: ("",), TEMPERATURE: ("", "C")} | {of: ("", *units) for of, units in QUANTITIES.items()}
# SensorLog has a clock for each sensor
SENSOR_CLOCKS = {"accelerometertimestampsincereboot": ACC, "gyrotimestampsincereboot": GYR}
# counts of 0.1 ms (Xsens MTi) or of us (Movella DOT)
COUNTS_OF_XSENS = "sampletimefine"
COLDEST_C, WARMEST_C = -60.0, 130.0
# iOS has the opposite sign of specific force: at rest it reads -1 g along the axis that points upwards
FLIPPED_STEMS = ("accelerometeracceleration",)
# accelerations from which a program has taken gravity
WITHOUT_GRAVITY = re.compile(r".*(?:free|user|linear)[ _]?acc(?!.*covariance)", re.IGNORECASE)
# vectors that turn as gravity does: a program's estimate of gravity, and a magnetic field; and attitudes, places and
# what else a board measures, whose parts may be as long
ESTIMATED = re.compile(
    r"gravity|^mag|magnet|quat|orientation|position|altitude|latitude|longitude|height|pressure|temperature|volt"
    r"|^q[_.]?[wxyz0-3]$|^r_?[0-3][0-3]$|(?<![a-z])ang[_ ]?[xyz](?![a-z])"
    r"|^(?!.*(?:rate|speed|vel|gyr|acc|omega)).*(?:roll|pitch|yaw|euler|heading|azimuth|angle|attitude|degree|dir_?cos)",
    re.IGNORECASE,
)
# numbers of samples, which are no times where they are whole
COUNTER = re.compile(r"^(?!.*(?:stamp|time)).*(?:packet|number|index|sequence|frame|sample|counter)", re.IGNORECASE)
# in a name of MATLAB
HYPHEN = "0x2[dD]"
# of a name, in characters
LONGEST_NAME = 100
# the rank of a column that the user or physics chose
CHOSEN = -1
# the rank of a column that one word alone calls a clock, such as mac_timestamp and esp32_ms
BY_A_WORD = len(STEMS[TIME])
_PREFIXES = ("field", "imu0", "imu1", "imu", "sensors", "sensor", "raw", "data", "phone", "body")
_AXIS = re.compile(r"([xyz])(?:[-_ ]?(?:axis|value))?\s*(?:[\[(](.*)[\])])?")
_BRACKETS = re.compile(r"(.*?)[\s_.]*[\[(]\s*([^\[\]()]*?)\s*[\])]\s*")
# a word of its own, also by its capitals: packetTime, MATLABtime
_WORDS_OF_TIME = "time|timestamp|stamp|millis|micros|date"
_CLOCK = re.compile(
    rf"(?:(?<![A-Za-z])(?i:{_WORDS_OF_TIME})|(?<=[A-Z])(?:{_WORDS_OF_TIME})|(?<=[A-Za-z])(?:{_WORDS_OF_TIME.title()}))"
    r"(?![a-z])"
)
_TURN = re.compile("(roll|pitch|yaw)(?:rate|speed|vel|velocity)|gyro?(roll|pitch|yaw)").fullmatch
_OF_DAY = re.compile(r"[hmsydf:/ .-]{5,}").fullmatch
_LETTER = re.compile("[A-Za-z]").search
# the ends of names that are units
_ENDINGS_OF_TIMES = "ns us ms s sec seconds"
ENDINGS_OF_SENSORS = (
    "mps2 m_s2 m/s2 ms2 cm_s2 mm_s2 ft_s2 g gs mg ug rads rad_s rad rad_per_s mrads dps deg_s degs deg deg_per_s"
    " mdps udps deg_h deg_hr rpm"
)
_WITH_ENDING = re.compile(rf"(.*?[a-z\]0-9])[_ ]({'|'.join(f'{_ENDINGS_OF_TIMES} {ENDINGS_OF_SENSORS}'.split())})")


@dataclass(frozen=True)
class Column:
    """A column whose name is known.

    Attributes
    ----------
    name, place : as in the header; places count from 0.
    quantity : TIME, NANOSECONDS, ACC, GYR or TEMPERATURE. axis : 0, 1, 2 of ACC and GYR.
    unit : the one in its name, or else its program's; empty where neither is known.
    rank : order of preference among columns of the same quantity.
    stem : the one in STEMS by which it is known; empty if it is known otherwise.
    """

    name: str
    place: int
    quantity: str
    axis: int = 0
    unit: str = ""
    rank: int = 0
    stem: str = ""


# a log names them on each line
@lru_cache
def parse_column_name(name: str, place: int) -> Column | None:
    """Return the column of that name at `place`; None if it holds nothing that is read."""
    text, axis, unit = name.strip().lstrip("#%").strip(), -1, ""
    if len(text) > LONGEST_NAME:
        return None
    while match := _BRACKETS.fullmatch(text):
        text, inside = match.groups()
        if (at := "012xyz".find(inside.lower())) >= 0 and len(inside) == 1:
            axis = at % 3
        elif _OF_DAY(inside.lower()):
            continue
        elif inside.lower().replace("°", "").removeprefix("deg ").strip() in ("c", "degc", "celsius", "℃"):
            unit = "C"
        elif not (unit := find_unit(inside)):
            return None
    text = text.lower()
    found = _match_stem(name, place, text, axis, unit)
    if found is None and not unit and (tail := _WITH_ENDING.fullmatch(text)):
        text, unit = tail[1], find_unit(tail[2])
        found = _match_stem(name, place, text, axis, unit)
    if found is None and axis < 0 and unit in UNITS[TIME] and (unit or _CLOCK.search(name)):
        return Column(name, place, TIME, unit=unit, rank=BY_A_WORD)
    return found


def _match_stem(name: str, place: int, text: str, axis: int, unit: str) -> Column | None:
    """Return the column whose stem is `text`, without or with prefixes; None if no stem is known."""
    word = _plain(text)
    words = [word, word.removesuffix("imu")]
    for prefix in _PREFIXES:
        if word.startswith(prefix) and len(word) > len(prefix):
            word = word.removeprefix(prefix)
            words.append(word)
    # a field of a structure, such as samples.acc.x
    words += [_plain(text[at + 1 :]) for at, letter in enumerate(text) if letter in ".:"]
    for word in words:
        for quantity, stems in STEMS.items():
            of_axes = quantity in (ACC, GYR)
            for stem, at in _split_axis(word, axis) if of_axes else [(word, axis)]:
                unit_of = PER_SAMPLE.get(unit, unit) if stem in INCREMENTS else unit
                if stem in stems and unit_of in UNITS[quantity] and of_axes == (at >= 0):
                    rank = list(stems).index(stem)
                    return Column(name, place, quantity, at, unit_of or stems[stem], rank, stem)
    return None


def _plain(text: str) -> str:
    return re.sub(r"[^a-z0-9]", "", text)


def _split_axis(word: str, axis: int) -> list[tuple[str, int]]:
    """Return the (stem, axis) that a word may consist of, such as ax, gyroX or xacc."""
    if axis >= 0:
        return [(word, axis)]
    found = []
    for suffix in ("", "raw", "adc", "lsb", "counts", "data", "value"):
        stem = word.removesuffix(suffix)
        if word.endswith(suffix) and stem[-1:] in ("x", "y", "z"):
            found.append((stem[:-1], "xyz".index(stem[-1])))
    if word[:1] in ("x", "y", "z"):
        found.append((word[1:], "xyz".index(word[0])))
    if turn := _TURN(word):
        found.append(("rotationrate", ("roll", "pitch", "yaw").index(turn[1] or turn[2])))
    return found


def ignored_sensors(header: Sequence[str], read: Sequence[Column]) -> str:
    """Return a remark on the columns of another IMU, which are not read; empty if there are none."""
    places = {column.place for column in read}
    # ax2, imu2_gyro_x
    others = (
        name.strip()
        for place, name in enumerate(header)
        if place not in places
        and re.search(r"\d", name)
        and (found := parse_column_name(re.sub(r"\d", "", name), place)) is not None
        and found.quantity in (ACC, GYR)
    )
    names = ", ".join(others)
    return f"columns of another IMU were not read (--sensor or --columns chooses): {names}" if names else ""


def parse_axis_name(name: str) -> tuple[int, str] | None:
    """Return (axis, unit) of a column called x, y, z, `x-axis (g)` and the like; None for any other."""
    found = _AXIS.fullmatch(name.strip().lower())
    return ("xyz".index(found[1]), find_unit(found[2] or "")) if found else None


def with_sensor(header: Sequence[str], sensor: str) -> list[str]:
    """Return a header whose columns x, y, z are called after a sensor."""
    axes = zip(header, map(parse_axis_name, header), strict=True)
    return [f"{sensor} {'xyz'[axis[0]]} ({axis[1]})".removesuffix(" ()") if axis else name for name, axis in axes]


def parse_header(header: Sequence[str]) -> list[Column]:
    """Return the columns of a header whose names are known."""
    # most lines that may be a header hold numbers
    if not any(map(_LETTER, header)):
        return []
    named = ((place, name) for place, name in enumerate(header) if _LETTER(name))
    return [column for place, name in named if (column := parse_column_name(name, place)) is not None]


@lru_cache
def axes_of(name: str) -> list[str]:
    """Return names for the columns x, y, z of a matrix or file that is called after a sensor; else an empty list."""
    last = re.sub(HYPHEN, "-", name.rpartition(".")[2])
    words = [last, *re.split(r"[^A-Za-z]+", last)]
    # MobileAccData, acceldata
    words += [word for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+", last) if len(word) > len("ac")]
    words += re.findall(r"accel|gyro", last.lower())
    for word in filter(None, words):
        found = parse_column_name(f"{word}_x", 0)
        if found is not None and found.quantity in (ACC, GYR):
            return [f"{word}_{axis}" for axis in "xyz"]
    return []


def axis_triples(columns: Sequence[Column], quantity: str) -> list[tuple[Column, ...]]:
    """Return the x, y, z columns of each sensor of a quantity, by the rank of its name; those with units first."""
    of = sorted(
        (column for column in columns if column.quantity == quantity), key=lambda c: (c.rank, not c.unit, c.unit)
    )
    found: list[tuple[Column, ...]] = []
    for _, group in groupby(of, lambda column: column.rank):
        # a logger may write counts beside what it made of them, and several sensors under one name
        same = [*group]
        of_units = [[*of_unit] for _, of_unit in groupby(same, lambda column: column.unit)]
        for each in of_units if len(same) > len("xyz") else [same]:
            axes = [[column for column in each if column.axis == axis] for axis in range(3)]
            if len(axes[0]) == len(axes[1]) == len(axes[2]):
                found += zip(*axes, strict=True)
    return found


def first_triple(columns: Sequence[Column], quantity: str) -> tuple[Column, ...]:
    """Return the first of axis_triples; empty if there is none."""
    return next(iter(axis_triples(columns, quantity)), ())


def names_both(columns: Sequence[Column]) -> bool:
    """Return True if there are those of an accelerometer and of a gyroscope."""
    return all(first_triple(columns, quantity) for quantity in (ACC, GYR))


def plausible_celsius(values: Vector) -> Vector | None:
    """Return temperatures (n,); None if no sensor has them, such as counts or Kelvin."""
    known = values[np.isfinite(values)]
    return values if len(known) and known.min() > COLDEST_C and known.max() < WARMEST_C else None
