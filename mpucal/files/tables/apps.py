"""What a phone's app says of a recording beside its tables: signs, and the time of day.

Sensor Logger's Metadata.csv has the platform: iOS counts gravity the other way, unless `standardisation` is true
(tszheichoi/awesome-sensor-logger, COORDINATES.md). phyphox's meta/time.csv has the time of day of each start
(phyphox-ios, ExperimentExport.swift); it turns the signs of iOS itself.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from pathlib import PurePath

from ...errors import RecordingError
from .text import NS, text_of

METADATA, TIME = "metadata.csv", "meta/time.csv"


@dataclass(frozen=True)
class Said:
    """Whether accelerations have the other sign, the time of day at time 0 [ns since 1970], and what else there is."""

    turned_around: bool = False
    zero_ns: int | None = None
    remarks: tuple[str, ...] = ()


def is_about(name: str) -> bool:
    """Whether a file of this name in a folder or an archive is one of them."""
    return PurePath(name).name.lower() == METADATA or PurePath(name).as_posix().lower().endswith(TIME)


def said(files: Mapping[str, bytes]) -> Said:
    """What the files say, by their names; nothing where there are none or they cannot be understood."""
    found = Said()
    for name, data in files.items():
        try:
            lines = text_of(data, name).splitlines()
            separator = next((cell for cell in ",;\t" if lines and cell in lines[0]), ",")
            read = list(csv.DictReader(lines, delimiter=separator))
        except (RecordingError, csv.Error):
            continue
        rows = [{key.lower(): cell for key, cell in row.items() if key and cell} for row in read]
        if name.lower().endswith(TIME):
            found = _of_phyphox(rows)
        elif rows and _is_of_ios(rows[0]):
            found = Said(turned_around=True, remarks=("accelerations with the other sign, as iOS has them",))
    return found


def _is_of_ios(row: Mapping[str, str]) -> bool:
    return row.get("platform", "").lower() == "ios" and row.get("standardisation", "").lower() != "true"


def _of_phyphox(rows: list[dict[str, str]]) -> Said:
    starts = [row for row in rows if row.get("event", "").upper() == "START"]
    if len(starts) > 1:
        return Said(remarks=(f"it was paused {len(starts) - 1} times, which its times leave out",))
    try:
        at = [Decimal(starts[0][key].replace(",", ".")) for key in ("system time", "experiment time")]
        return Said(zero_ns=int((at[0] - at[1]) * NS))
    except (IndexError, KeyError, ArithmeticError, ValueError):
        return Said()
