"""Metadata that a phone's app writes beside its tables: the sign of accelerations and the time of day.

Sensor Logger's Metadata.csv has the platform: on iOS accelerations have the opposite sign, unless `standardisation` is
true (tszheichoi/awesome-sensor-logger, COORDINATES.md). phyphox's meta/time.csv has the time of day of each start
(phyphox-ios, ExperimentExport.swift); phyphox corrects the sign itself.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from pathlib import PurePath

from ...errors import RecordingError
from .text import decode_text
from .units import NS

METADATA, TIME = "metadata.csv", "meta/time.csv"
FLIPPED = "accelerations have the opposite sign, as on iOS, and were negated"


@dataclass(frozen=True)
class AppMetadata:
    """Metadata of a recording: sign of its accelerations, time of day at time 0 [ns since 1970], remarks."""

    sign_flipped: bool = False
    zero_ns: int | None = None
    remarks: tuple[str, ...] = ()


def is_app_metadata(name: str) -> bool:
    """Return True if a file of this name in a folder or archive is metadata."""
    return PurePath(name).name.lower() == METADATA or PurePath(name).as_posix().lower().endswith(TIME)


def read_app_metadata(files: Mapping[str, bytes]) -> AppMetadata:
    """Return the metadata in files (name -> content); files that cannot be parsed are ignored."""
    found = AppMetadata()
    for name, data in files.items():
        try:
            lines = decode_text(data, name).splitlines()
            separator = next((cell for cell in ",;\t" if lines and cell in lines[0]), ",")
            read = list(csv.DictReader(lines, delimiter=separator))
        except (RecordingError, csv.Error):
            continue
        rows = [{key.lower(): cell for key, cell in row.items() if key and cell} for row in read]
        first = {key: cell.lower() for key, cell in rows[0].items()} if rows else {}
        if name.lower().endswith(TIME):
            found = _from_phyphox(rows)
        elif first.get("platform") == "ios" and first.get("standardisation") != "true":
            found = AppMetadata(sign_flipped=True, remarks=(FLIPPED,))
    return found


def _from_phyphox(rows: list[dict[str, str]]) -> AppMetadata:
    starts = [row for row in rows if row.get("event", "").upper() == "START"]
    if len(starts) > 1:
        return AppMetadata(remarks=(f"it was paused {len(starts) - 1} times, and its times do not count the pauses",))
    try:
        at = [Decimal(starts[0][key].replace(",", ".")) for key in ("system time", "experiment time")]
        return AppMetadata(zero_ns=int((at[0] - at[1]) * NS))
    except (IndexError, KeyError, ArithmeticError, ValueError):
        return AppMetadata()
