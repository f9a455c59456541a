"""Units by their names, and the choice where the file names a unit and its samples show one."""

from __future__ import annotations

import math

from ...data import STANDARD_GRAVITY_MPS2
from ...errors import RecordingError

COUNTS, DAYS = "counts", "days"
# quantity -> unit -> SI
QUANTITIES = {
    "t": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "0.1ms": 1e-4, DAYS: 86400.0, "h": 3600.0, "min": 60.0},
    "acc": {
        "m/s^2": 1.0,
        "g": STANDARD_GRAVITY_MPS2,
        "mg": STANDARD_GRAVITY_MPS2 / 1000,
        "cm/s^2": 0.01,
        "mm/s^2": 0.001,
        "ft/s^2": 0.3048,
        "ug": STANDARD_GRAVITY_MPS2 / 1e6,
        "mg/10": STANDARD_GRAVITY_MPS2 / 1e4,
        COUNTS: math.nan,
    },
    "gyr": {
        "rad/s": 1.0,
        "deg/s": math.radians(1),
        "mdeg/s": math.radians(1e-3),
        "mrad/s": 1e-3,
        "deg/h": math.radians(1 / 3600),
        "rpm": math.radians(6),
        "udeg/s": math.radians(1e-6),
        "deg/s/16": math.radians(1 / 16),
        "deg/s/10": math.radians(1 / 10),
        "deg/s/100": math.radians(1 / 100),
        COUNTS: math.nan,
    },
}
# units of what an integrating sensor gives for each sample, increments of velocity and angle -> of these by the time
PER_SAMPLE = {"m/s/sample": "m/s^2", "rad/sample": "rad/s", "deg/sample": "deg/s"}
# as `--units acc=` names them, beside angles in the unit that most programs write
OF_INCREMENTS = "m/s/sample,gyr=rad/sample"
# the counts of a BNO055 (BST-BNO055-DS000, UNIT_SEL 0), which samples hardly tell from mg and mrad/s
OF_BNO055 = {"acc": "cm/s^2", "gyr": "deg/s/16"}
_SPELLED = {
    "s": "s sec secs second seconds",
    "ms": "ms msec millis millisec millisecond milliseconds",
    "us": "us usec micros microsec microsecond microseconds",
    "ns": "ns nsec nanos nanosec nanosecond nanoseconds",
    DAYS: "d day days",
    "h": "h hr hrs hour hours",
    "min": "min mins minute minutes",
    "m/s^2": "m/s2 ms-2 m/s/s mps2 ms2 m/(s2) m/s**2 meters/second2 m/sec2",
    "g": "g gs g's g-force gforce gee g0",
    "mg": "mg milli-g millig",
    "cm/s^2": "cm/s2 cms2 gal",
    "mm/s^2": "mm/s2 mms2",
    "ft/s^2": "ft/s2 fts2 ft/s/s feet/s2",
    "ug": "ug micro-g microg",
    "mg/10": "mg/10 0.1mg 1/10mg",
    "rad/s": "rad/s radpers rads-1 radps rads rad/sec radians/s rps rad",
    "deg/s": "deg/s degpers degs-1 degps degs dps deg/sec degrees/s degree/s degrees/sec deg",
    "mdeg/s": "mdeg/s mdps",
    "mrad/s": "mrad/s mrads",
    "deg/h": "deg/h deg/hr degh deghr",
    "rpm": "rpm rev/min",
    "udeg/s": "udeg/s udps",
    "deg/s/16": "deg/s/16",
    "deg/s/10": "deg/s/10 0.1deg/s 1/10deg/s",
    "deg/s/100": "deg/s/100 0.01deg/s 1/100deg/s",
    COUNTS: "counts count lsb raw adc",
    "m/s/sample": "m/s m/s/sample",
    "rad/sample": "rad/sample",
    "deg/sample": "deg/sample",
}
_NAMES = {spelled: unit for unit, words in _SPELLED.items() for spelled in words.split()}
_PLAIN = str.maketrans(
    {"²": "2", "µ": "u", "μ": "u", "°": "deg", "^": "", " ": "", "·": "", "*": "", "_": "", "⁻": "-", "¹": "1"}
)
# the units that most programs write
LIKELY = {"t": "s", "acc": "m/s^2", "gyr": "deg/s"}


def find_unit(text: str) -> str:
    """Return the unit that a text names, or an empty text."""
    return _NAMES.get(text.strip().lower().translate(_PLAIN), "")


def resolve_unit(name: str, quantity: str, said: str, seen: str, evidence: str, *, likely: bool = True) -> str:
    """Return the unit that was named, or else the one that the samples show.

    Parameters
    ----------
    said, seen : these units; empty if unknown. evidence : the observation behind `seen`, for the message.
    likely : whether the unit that most programs write is one to try.

    Raises
    ------
    RecordingError : both are unknown, or they differ.
    """
    if said and seen and said != seen:
        raise RecordingError(
            f"{name}: {quantity} is said to be in {said}, but {evidence} suggests {seen}",
            f"choose one with --units {quantity}={said} or --units {quantity}={seen}",
            f"--units {quantity}={seen}",
        )
    if not said and not seen:
        usual, known = LIKELY[quantity], ", ".join(unit for unit in QUANTITIES[quantity] if unit != LIKELY[quantity])
        raise RecordingError(
            f"{name}: the unit of {quantity} is not known, and {evidence} fits none",
            f"name it with --units {quantity}={usual}, or another of {known}"
            if likely
            else f"convert it to {usual}, or name it with --units {quantity}=UNIT, one of {known}",
            f"--units {quantity}={usual}" if likely else "",
        )
    return said or seen
