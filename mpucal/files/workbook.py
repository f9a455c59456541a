"""Workbooks of spreadsheets (.xlsx, ISO/IEC 29500-1, section 18): their sheets as tables of text.

Dates are days since 1900 in the file, and are read as days.
"""

from __future__ import annotations

import csv
import re
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from io import BytesIO, StringIO
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError, iterparse

from ..data import Recording
from ..errors import RecordingError
from .hints import NO_HINTS, Hints
from .reading import DAMAGED_ZIP, MEMORY_PER_TEXT, check_size, whole
from .tables.load import find_any_table, is_table_of_sensors, table_of_text
from .tables.names import ACC, GYR, first_triple
from .tables.phone import is_pair, recording_of_tables
from .tables.table import Table

_SHEET = re.compile(r"xl/worksheets/sheet(\d{1,4})\.xml").fullmatch
_STRINGS, _BOOK, _RELATIONS = "xl/sharedStrings.xml", "xl/workbook.xml", "xl/_rels/workbook.xml.rels"
_REMEDY = "save its sheet as .csv"


def load_workbook(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """Return the recording in the first sheet that names both sensors, or in a sheet for each, or else in the first.

    Raises
    ------
    RecordingError : it cannot be read, or does not say all that is needed; the message names what is missing.
    """
    with whole(path, "workbook", _REMEDY, (*DAMAGED_ZIP, LookupError, ParseError)), zipfile.ZipFile(path) as archive:
        check_size(path, MEMORY_PER_TEXT * sum(member.file_size for member in archive.infolist()))
        sheets = dict(_sheets(archive))
    if not sheets:
        raise RecordingError(f"{path} holds no xl/worksheets/sheet1.xml", _REMEDY)
    texts = [*sheets.values()]
    chosen = next((text for text in texts if is_table_of_sensors(text, path.name)), None)
    if chosen is None and not hints.columns and is_pair(tables := _tables(sheets)):
        return recording_of_tables(path.name, tables, hints)
    return table_of_text(chosen or texts[0], path, hints)


def _tables(sheets: Mapping[str, str]) -> dict[str, Table]:
    """Return the tables of sheets under their names, or under that of the sensor whose columns they name."""
    found: dict[str, Table] = {}
    for name, text in sheets.items():
        if (table := find_any_table(text, name)) is not None:
            sensors = [of for of in (ACC, GYR) if first_triple(table.columns, of)]
            found[sensors[0] if len(sensors) == 1 else name] = table
    return found


def _sheets(archive: zipfile.ZipFile) -> Iterator[tuple[str, str]]:
    """Yield the name and the text of each sheet, whose cells are separated by commas."""
    strings = []
    if _STRINGS in archive.namelist():
        strings = [_text(item) for item in _elements(archive.read(_STRINGS), "si")]
    found = sorted((int(match[1]), name) for name in archive.namelist() if (match := _SHEET(name)))
    titles = _titles(archive)
    for _, name in found:
        text, rows = StringIO(), (_cells(row, strings) for row in _elements(archive.read(name), "row"))
        csv.writer(text, lineterminator="\n").writerows(rows)
        yield titles.get(name, name), text.getvalue()


def _titles(archive: zipfile.ZipFile) -> dict[str, str]:
    """Return the path of a sheet -> its name; empty if the workbook does not say it."""
    if not {_BOOK, _RELATIONS} <= {*archive.namelist()}:
        return {}
    paths = {each.get("Id"): f"xl/{each.get('Target')}" for each in _elements(archive.read(_RELATIONS), "Relationship")}
    of_sheets = [dict(each.attrib) for each in _elements(archive.read(_BOOK), "sheet")]
    # the attribute `id` has the namespace of relationships
    ids = [next((value for key, value in of.items() if key.endswith("}id")), "") for of in of_sheets]
    return {paths.get(at, ""): of.get("name", "") for at, of in zip(ids, of_sheets, strict=True)}


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
        # the last of a sheet's columns is XFD
        if not len(found) <= place < 16384:
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
