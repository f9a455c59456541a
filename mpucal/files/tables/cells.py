"""Cells of a column as exact numbers: of text with a point or a comma, dates and times of day, or of arrays."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from decimal import Decimal, InvalidOperation
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...clocks import US, S
from ...clocks.sample_clock import GAP_INTERVALS
from ...data import Vector
from ...strict_json import MOST_DIGITS
from ..reading import MOST_ODD
from .units import DAYS, QUANTITIES

# cells by which a column's kind is known
LOOKED_AT = 50
DAY_NS = round(QUANTITIES["t"][DAYS]) * S
CLOCK = r"\d\d?:\d\d:\d\d(?:[.,]\d{1,9})?"
# among other text; lengths are bounded: the search takes linear time
NUMBER = r"[-+]?(?:\d{1,20}\.?\d{0,20}|\.\d{1,20})(?:[eE][-+]?\d{1,3})?"
MOMENT = rf"(?:\d{{4}}-\d\d-\d\d[ T])?{CLOCK}(?:Z|[+-]\d\d:?\d\d)?"
# the hours may be missing; days are those of pandas' durations, and milliseconds may follow a colon
_TIME_OF_DAY = re.compile(
    r"(?:(\d{1,6}) days? )?(?:(\d\d?):)?(\d\d):(\d\d)((?:\.|(?<=\d:\d\d:\d\d):)\d+)?(?: ?([AaPp])\.?[Mm]\.?)?"
).fullmatch
# the same with other marks between its parts: 12.03.04.123; without the last it may be a date
_MARKED_OF_DAY = re.compile(r"([01]?\d|2[0-3])([.\-_])([0-5]\d)\2([0-5]\d)[.,:\-_](\d{1,9})").fullmatch
# a date that does not begin with the year, or not as ISO 8601 has it, and a time of day
_DATE = re.compile(r"(\d{1,4})([./-])(\d{1,2}|[A-Za-z]{3})\2(\d{1,4}),?[ T]+(\S.*)").fullmatch
# a date and time of day in digits alone
_COMPACT = re.compile(
    r"(20\d\d)(0[1-9]|1[0-2])([0-3]\d)[T_ -]?([01]\d|2[0-3])([0-5]\d)([0-5]\d)[._]?(\d{0,6})(Z?)"
).fullmatch
# the same with marks other than those of ISO 8601 between all parts: 2024-5-1--12-03-04-123
_MARKED = re.compile(
    r"(20\d\d)[-_/.](\d\d?)[-_/.](\d\d?)[-_ T]{1,2}(\d\d?)[-_.](\d\d?)[-_.](\d\d?)(?:[-_.,:](\d{1,6}))?(Z?)"
).fullmatch
# the time of day without the date, as the first cell of a column has it; the numbers then show if it is one
OF_DAY = re.compile(r"\s*([01]\d|2[0-3])([0-5]\d){2}(\.\d+|\d{3})?\s*").fullmatch
# counts; of two digits it is a chip's address, which names a sensor
_HEXADECIMAL = re.compile(r"\s*0x[\dA-Fa-f]{3,8}\s*").fullmatch
_ISO = re.compile(r"\d{4}-\d\d-\d\d").match
_MONTHS = "janfebmaraprmayjunjulaugsepoctnovdec"

Cells = Sequence[str] | NDArray[Any]


class Kind(Enum):
    """Content of most cells of a column."""

    NUMBER = "numbers"
    MOMENT = "dates or times of day"
    WORD = "words, or nothing"


def kind_of(cells: Cells) -> Kind:
    """Return the kind of a column by some of its cells, of which a few may be damaged, and the last torn."""
    if isinstance(cells, np.ndarray):
        return {"M": Kind.MOMENT, "m": Kind.MOMENT, "i": Kind.NUMBER, "u": Kind.NUMBER, "f": Kind.NUMBER}.get(
            cells.dtype.kind, Kind.WORD
        )
    some = [cell for cell in cells[:: max(len(cells) // LOOKED_AT, 1)][: LOOKED_AT + 1] if cell.strip()]
    for kind, dates in ((Kind.NUMBER, False), (Kind.MOMENT, True)):
        if some and sum(is_number(cell, dates) for cell in some) > (1 - MOST_ODD) * len(some):
            return kind
    return Kind.WORD


def with_point(text: str) -> str:
    """Return a number's text with a decimal point in place of a comma, and in decimal digits."""
    if "x" in text and _HEXADECIMAL(text):
        return str(int(text, 16))
    return text.replace(",", ".") if "," in text and "." not in text else text


def parse_cell(text: str) -> Decimal:
    """Return a number, or a date's ns since 1970 (since the year 1 without a zone), or a time of day's ns.

    Raises
    ------
    ValueError : it is none of these.
    """
    text = text.strip()
    if found := _COMPACT(text) or _MARKED(text):
        text = "{}-{:0>2}-{:0>2}T{:0>2}:{:0>2}:{:0>2}.{:0<6}{}".format(*found.groups(""))
    try:
        number = Decimal(with_point(text))
        # other exponents would take all memory as integers
        if number.is_finite() and abs(number.adjusted()) < MOST_DIGITS:
            return number
    except InvalidOperation:
        date, of_day = (None, text) if _ISO(text) or not (split := _DATE(text)) else (split, split[5])
        if marked := _MARKED_OF_DAY(of_day):
            of_day = f"{marked[1]}:{marked[3]}:{marked[4]}.{marked[5]}"
        if found := _TIME_OF_DAY(with_point(of_day)):
            days, hours, minutes, seconds, below, half = found.groups()
            hour = int(hours or 0) if half is None else int(hours or 0) % 12 + 12 * (half in "Pp")
            at = ((24 * int(days or 0) + hour) * 60 + int(minutes)) * 60 + int(seconds)
            before = _days(*date.groups()[:4]) if date else 0
            return before * DAY_NS + (at + Decimal(f"0.{(below or '.0')[1:]}")) * S
        moment = datetime.fromisoformat(re.sub(" (?:UTC|GMT)$", "Z", text))
        since = moment - (datetime(1970, 1, 1, tzinfo=UTC) if moment.tzinfo else datetime.min)
        return Decimal(since // timedelta(microseconds=1) * US)
    raise ValueError(text)


def _days(first: str, mark: str, middle: str, last: str) -> int:
    """Return the days since the year 1 of 2024/5/1, 1.5.2024, 01-May-2024 or 5/1/2024, by the mark between them."""
    day, month, year = (last, middle, first) if len(first) == len("2024") else (first, middle, last)
    if mark == "/" and day == first and int(first) <= len(_MONTHS) // 3:
        day, month = middle, first
    months = _MONTHS.find(month.lower()) // 3 + 1 if month.isalpha() else int(month)
    return datetime(int(year), months, int(day)).toordinal() - 1


def since_midnight(times: NDArray[Any]) -> Vector | None:
    """Return seconds of numbers (n,) that are times of day in digits (hhmmss.sss, hhmmssmmm); None of any others.

    They are if no part exceeds a day's, and the clock goes on evenly where a minute begins.
    """
    numbers = np.asarray(times, float)
    for scale in (1.0, 1000.0) if np.isfinite(numbers).all() else ():
        minutes, seconds = np.divmod(numbers / scale, 100.0)
        hours, minutes = np.divmod(minutes, 100.0)
        if (seconds < 60).all() and (minutes < 60).all() and (hours < 24).all() and (hours >= 0).all():
            found = (60.0 * hours + minutes) * 60.0 + seconds
            steps, begins = np.diff(found), np.diff(minutes) != 0.0
            usual = float(np.median(steps)) if len(steps) else 0.0
            if begins.any() and ((steps[begins] > 0.0) & (steps[begins] <= GAP_INTERVALS * usual)).all():
                return np.asarray(found)
    return None


def is_number(cell: str, dates: bool = True) -> bool:
    """Return True if a cell holds a number, or a date or time of day if `dates`."""
    try:
        parse_cell(cell)
        text = cell.strip()
        return dates or (not (_COMPACT(text) or _MARKED(text)) and Decimal(with_point(text)).is_finite())
    except (ValueError, InvalidOperation):
        return False


def since_first(times: NDArray[Any]) -> tuple[Vector, Decimal]:
    """Return exact times (n,) as floats since the first, and the first."""
    if not len(times):
        return np.zeros(0), Decimal(0)
    # infinite times are refused where their steps are needed
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(times - times[0], float), Decimal(str(times[0]))
