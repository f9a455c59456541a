"""Units by their names, and the choice where the file names a unit and its samples show one."""

from __future__ import annotations

import math

from ...data import STANDARD_GRAVITY_MPS2
from ...errors import RecordingError

COUNTS, DAYS = "counts", "days"
# quantity -> unit, its size in SI, and how else programs spell it, in lower case without blanks and powers' marks
_UNITS: dict[str, tuple[tuple[str, float, str], ...]] = {
    "t": (
        ("s", 1.0, "sec secs second seconds"),
        ("ms", 1e-3, "msec millis millisec millisecond milliseconds"),
        ("us", 1e-6, "usec micros microsec microsecond microseconds"),
        ("ns", 1e-9, "nsec nanos nanosec nanosecond nanoseconds"),
        ("0.1ms", 1e-4, ""),
        (DAYS, 86400.0, "d day"),
        ("h", 3600.0, "hr hrs hour hours"),
        ("min", 60.0, "mins minute minutes"),
    ),
    "acc": (
        ("m/s^2", 1.0, "ms-2 m/s/s mps2 ms2 m/(s2) meters/second2 m/sec2"),
        ("g", STANDARD_GRAVITY_MPS2, "gs g's g-force gforce gee g0"),
        ("mg", STANDARD_GRAVITY_MPS2 / 1000, "milli-g millig"),
        ("cm/s^2", 0.01, "cms2 gal"),
        ("mm/s^2", 0.001, "mms2"),
        ("ft/s^2", 0.3048, "fts2 ft/s/s feet/s2"),
        ("ug", STANDARD_GRAVITY_MPS2 / 1e6, "micro-g microg"),
        ("mg/10", STANDARD_GRAVITY_MPS2 / 1e4, "0.1mg 1/10mg"),
        (COUNTS, math.nan, "count lsb raw adc"),
    ),
    "gyr": (
        ("rad/s", 1.0, "radpers rads-1 radps rads rad/sec radians/s rps rad"),
        ("deg/s", math.radians(1), "degpers degs-1 degps degs dps deg/sec degrees/s degree/s degrees/sec deg"),
        ("mdeg/s", math.radians(1e-3), "mdps"),
        ("mrad/s", 1e-3, "mrads"),
        ("deg/h", math.radians(1 / 3600), "deg/hr degh deghr"),
        ("rpm", math.radians(6), "rev/min"),
        ("udeg/s", math.radians(1e-6), "udps"),
        ("deg/s/16", math.radians(1 / 16), ""),
        ("deg/s/10", math.radians(1 / 10), "0.1deg/s 1/10deg/s"),
        ("deg/s/100", math.radians(1 / 100), "0.01deg/s 1/100deg/s"),
        (COUNTS, math.nan, ""),
    ),
}
# quantity -> unit -> SI
QUANTITIES = {quantity: {unit: si for unit, si, _ in units} for quantity, units in _UNITS.items()}
# units of what an integrating sensor gives for each sample, increments of velocity and angle -> of these by the time
PER_SAMPLE = {"m/s/sample": "m/s^2", "rad/sample": "rad/s", "deg/sample": "deg/s"}
# as `--units acc=` names them, beside angles in the unit that most programs write
OF_INCREMENTS = "m/s/sample,gyr=rad/sample"
# the counts of a BNO055 (BST-BNO055-DS000, UNIT_SEL 0), which samples hardly tell from mg and mrad/s
OF_BNO055 = {"acc": "cm/s^2", "gyr": "deg/s/16"}
_PLAIN = str.maketrans(
    {"²": "2", "µ": "u", "μ": "u", "°": "deg", "^": "", " ": "", "·": "", "*": "", "_": "", "⁻": "-", "¹": "1"}
)
_SPELLED = [
    (unit, spelled) for units in _UNITS.values() for unit, _, words in units for spelled in (unit, *words.split())
]
_SPELLED += [(unit, unit) for unit in PER_SAMPLE] + [("m/s/sample", "m/s")]
_NAMES = {spelled.translate(_PLAIN): unit for unit, spelled in _SPELLED}
# the units that most programs write
LIKELY = {"t": "s", "acc": "m/s^2", "gyr": "deg/s"}


def find_unit(text: str) -> str:
    """Return the unit that a text names, or an empty text."""
    return _NAMES.get(text.strip().lower().translate(_PLAIN), "")


def resolve_unit(name: str, quantity: str, named: str, seen: str, evidence: str, *, likely: bool = True) -> str:
    """Return the unit that was named, or else the one that the samples show.

    Parameters
    ----------
    named, seen : these units; empty if unknown. evidence : the observation behind `seen`, for the message.
    likely : whether the unit that most programs write is one to try.

    Raises
    ------
    RecordingError : both are unknown, or they differ.
    """
    if named and seen and named != seen:
        raise RecordingError(
            f"{name}: {quantity} is said to be in {named}, but {evidence} suggests {seen}",
            f"choose one with --units {quantity}={named} or --units {quantity}={seen}",
            f"--units {quantity}={seen}",
        )
    if not named and not seen:
        usual, known = LIKELY[quantity], ", ".join(unit for unit in QUANTITIES[quantity] if unit != LIKELY[quantity])
        raise RecordingError(
            f"{name}: the unit of {quantity} is not known, and {evidence} fits none",
            f"name it with --units {quantity}={usual}, or another of {known}"
            if likely
            else f"convert it to {usual}, or name it with --units {quantity}=UNIT, one of {known}",
            f"--units {quantity}={usual}" if likely else "",
        )
    return named or seen
