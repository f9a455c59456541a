"""Workbooks of spreadsheets (.xlsx, ISO/IEC 29500-1, section 18): their sheets as tables of text.

Dates are days since 1900 in the file, and are read as days.
"""

from __future__ import annotations

import csv
import re
import zipfile
from collections.abc import Iterator, Sequence
from io import BytesIO, StringIO
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError, iterparse

from ..data import Recording
from ..errors import RecordingError
from .hints import NO_HINTS, Hints
from .reading import DAMAGED_ZIP, HELD, check_size, reading
from .tables.load import is_table_of_sensors, table_of_text

_SHEET = re.compile(r"xl/worksheets/sheet(\d{1,4})\.xml").fullmatch
_STRINGS = "xl/sharedStrings.xml"
# columns of a sheet, of which the last is XFD
MOST_COLUMNS = 16384


def load_workbook(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """Return the recording in the first sheet that names an accelerometer and a gyroscope, or else in the first.

    Raises
    ------
    RecordingError : it cannot be read, or does not say all that is needed; the message names what is missing.
    """
    try:
        with reading(path), zipfile.ZipFile(path) as archive:
            check_size(path, HELD * sum(member.file_size for member in archive.infolist()))
            sheets = [*_sheets(archive)]
    except (*DAMAGED_ZIP, LookupError, ParseError) as error:
        raise RecordingError(f"{path} is not a whole workbook ({error})", "save its sheet as .csv") from error
    if not sheets:
        raise RecordingError(f"{path} holds no xl/worksheets/sheet1.xml", "save its sheet as .csv")
    chosen = next((text for text in sheets if is_table_of_sensors(text, path.name)), sheets[0])
    return table_of_text(chosen, path, hints)


def _sheets(archive: zipfile.ZipFile) -> Iterator[str]:
    """Yield the text of each sheet, whose cells are separated by commas."""
    strings = []
    if _STRINGS in archive.namelist():
        strings = [_text(item) for item in _elements(archive.read(_STRINGS), "si")]
    found = sorted((int(match[1]), name) for name in archive.namelist() if (match := _SHEET(name)))
    for _, name in found:
        text, rows = StringIO(), (_cells(row, strings) for row in _elements(archive.read(name), "row"))
        csv.writer(text, lineterminator="\n").writerows(rows)
        yield text.getvalue()


def _elements(data: bytes, tag: str) -> Iterator[Element]:
    """Yield the elements of a tag, whatever their namespace, and forget each."""
    if b"<!DOCTYPE" in data:
        raise ValueError("it defines entities")
    for _, element in iterparse(BytesIO(data)):
        if _tag(element) == tag:
            yield element
            element.clear()


def _tag(element: Element) -> str:
    return element.tag.rpartition("}")[2]


def _text(element: Element) -> str:
    """Return the text in an element's values, without tabs and ends of lines."""
    return " ".join("".join(each.text or "" for each in element.iter() if _tag(each) in ("v", "t")).split())


def _cells(row: Element, strings: Sequence[str]) -> list[str]:
    """Return the cells of a row, with those that the file leaves out."""
    found: list[str] = []
    for cell in row:
        place = _place(cell.get("r", "")) if cell.get("r") else len(found)
        if not len(found) <= place < MOST_COLUMNS:
            raise ValueError(f"a cell is at {cell.get('r')}")
        text = _text(cell)
        found += [""] * (place - len(found))
        found.append(strings[int(text)] if cell.get("t") == "s" and text else text)
    return found


def _place(name: str) -> int:
    """Return the column of a cell such as AB12, from 0."""
    place = 0
    for letter in name.rstrip("0123456789"):
        place = 26 * place + ord(letter) - ord("A") + 1
    return place - 1
