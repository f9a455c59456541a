"""Workbooks: a session's samples in cells, as spreadsheets and libraries write them."""

import zipfile
from itertools import chain

import numpy as np
import pytest

import mpucal
from mpucal.errors import RecordingError

HEADER = ("time", "Accel X", "Accel Y", "Accel Z", "Gyro X", "Gyro Y", "Gyro Z")
NAMESPACE = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
RELATIONS = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
STRICT = "http://purl.oclc.org/ooxml/spreadsheetml/main"


def write(path, rows, sheets=(), namespace=NAMESPACE, first_column="B"):
    """Write a workbook whose last sheet has these rows, from `first_column` on, and whose names are shared strings."""
    columns = "ABCDEFGHIJKLMN"["ABC".index(first_column) :]
    names = list(dict.fromkeys(cell for cell in chain(*rows) if isinstance(cell, str)))

    def cell_of(value, at):
        if isinstance(value, str):
            return f'<x:c r="{at}" t="s"><x:v>{names.index(value)}</x:v></x:c>'
        return "" if value is None else f'<x:c r="{at}"><x:f>1+1</x:f><x:v>{value!r}</x:v></x:c>'

    cells = [
        "".join(cell_of(value, f"{column}{number}") for value, column in zip(row, columns, strict=False))
        for number, row in enumerate(rows, 1)
    ]
    data = "".join(f'<x:row r="{number}">{row}</x:row>' for number, row in enumerate(cells, 1))
    made = [*sheets, f'<x:worksheet xmlns:x="{namespace}"><x:sheetData>{data}</x:sheetData></x:worksheet>']
    shared = "".join(f"<x:si><x:r><x:t>{name}</x:t></x:r></x:si>" for name in names)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as book:
        book.writestr("xl/sharedStrings.xml", f'<x:sst xmlns:x="{namespace}">{shared}</x:sst>')
        for number, sheet in enumerate(made, 1):
            book.writestr(f"xl/worksheets/sheet{number}.xml", sheet)


def rows_of(walk, t):
    return [HEADER, *np.column_stack([t, walk.acc, walk.gyr]).tolist()]


NOTES = (
    f'<worksheet xmlns="{NAMESPACE}"><sheetData><row><c t="inlineStr"><is><t>measured by hand</t></is></c></row>'
    "</sheetData></worksheet>"
)


@pytest.mark.parametrize("namespace", [NAMESPACE, STRICT])
@pytest.mark.parametrize("sheets", [(), (NOTES,)], ids=["one sheet", "behind a sheet of notes"])
def test_a_sheet_is_read_as_a_table(sheets, namespace, walk, assert_same, tmp_path):
    write(tmp_path / "walk.xlsx", rows_of(walk, walk.t), sheets, namespace)
    found = mpucal.load(tmp_path / "walk.xlsx")
    assert_same(found, walk)
    assert found.taken.endswith("times in s, accelerations in m/s^2 and rates in rad/s.")


@pytest.mark.parametrize(
    ("titles", "acc", "gyr"),
    [
        (("Accelerometer", "Gyroscope"), "X,Y,Z", "X,Y,Z"),
        (("Sheet1", "Sheet2"), "ax,ay,az", "gx,gy,gz"),
        (("Linear", "Raw"), "Acceleration x (m/s^2),Acceleration y (m/s^2),Acceleration z (m/s^2)", "wx,wy,wz"),
    ],
)
def test_a_sheet_for_each_sensor(titles, acc, gyr, walk, assert_same, tmp_path):
    """Read both, by the sheets' names or by those of their columns; the files of sheets may be in another order."""
    sheets = [
        [("time", *names.split(",")), *np.column_stack([walk.t, values]).tolist()]
        for names, values in ((acc, walk.acc), (gyr, walk.gyr))
    ]
    of = f'<sheets xmlns:r="{RELATIONS}">{{}}</sheets>'
    entries = "".join(f'<sheet name="{title}" r:id="rId{at}"/>' for at, title in enumerate(titles))
    targets = "".join(f'<Relationship Id="rId{at}" Target="worksheets/sheet{2 - at}.xml"/>' for at in range(2))
    with zipfile.ZipFile(tmp_path / "walk.xlsx", "w", zipfile.ZIP_DEFLATED) as book:
        book.writestr("xl/workbook.xml", f'<workbook xmlns="{NAMESPACE}">{of.format(entries)}</workbook>')
        book.writestr("xl/_rels/workbook.xml.rels", f"<Relationships>{targets}</Relationships>")
        for at, rows in enumerate(sheets):
            book.writestr(f"xl/worksheets/sheet{2 - at}.xml", sheet_of(rows))
    assert_same(mpucal.load(tmp_path / "walk.xlsx"), walk)


def sheet_of(rows):
    """Return a sheet whose texts are in its cells."""
    cells = [
        "".join(
            f'<c t="inlineStr"><is><t>{v}</t></is></c>' if isinstance(v, str) else f"<c><v>{v!r}</v></c>" for v in row
        )
        for row in rows
    ]
    data = "".join(f"<row>{row}</row>" for row in cells)
    return f'<worksheet xmlns="{NAMESPACE}"><sheetData>{data}</sheetData></worksheet>'


def test_dates_are_days(walk, assert_same, tmp_path):
    write(tmp_path / "walk.xlsx", rows_of(walk, 45413.5 + walk.t / 86400))
    assert_same(mpucal.load(tmp_path / "walk.xlsx"), walk, t=2e-6)


def test_text_in_cells_may_hold_commas(walk, assert_same, tmp_path):
    rows = rows_of(walk, walk.t)
    rows[1:] = [[f"{number!r}".replace(".", ",") for number in row] for row in rows[1:]]
    write(tmp_path / "walk.xlsx", [("walked, then turned",), *rows])
    assert_same(mpucal.load(tmp_path / "walk.xlsx"), walk)


def test_cells_that_are_left_out_are_empty(walk, tmp_path):
    """Leave out the sample whose cell a sheet lacks, and keep the others' places."""
    rows = rows_of(walk, walk.t)
    rows[8][2] = None
    write(tmp_path / "walk.xlsx", rows)
    np.testing.assert_array_equal(mpucal.load(tmp_path / "walk.xlsx").acc, np.delete(walk.acc, 7, axis=0))


@pytest.mark.parametrize(
    "sheet",
    [
        np.random.default_rng(3).bytes(1 << 12),
        f'<!DOCTYPE a [<!ENTITY b "c">]><worksheet xmlns="{NAMESPACE}"><row><c><v>&b;</v></c></row></worksheet>',
        f'<worksheet xmlns="{NAMESPACE}"><row><c r="ZZZZZZ1"><v>1</v></c></row></worksheet>',
        f'<worksheet xmlns="{NAMESPACE}"><row><c r="B1"><v>1</v></c><c r="A1"><v>1</v></c></row></worksheet>',
        f'<worksheet xmlns="{NAMESPACE}"><row><c t="s"><v>7</v></c></row></worksheet>',
    ],
    ids=["noise", "entities", "a column that no sheet has", "cells out of order", "a string that is missing"],
)
def test_a_damaged_workbook_is_to_be_exported(sheet, tmp_path):
    with zipfile.ZipFile(tmp_path / "walk.xlsx", "w") as book:
        book.writestr("xl/worksheets/sheet1.xml", sheet)
    with pytest.raises(RecordingError, match=r"is not a whole workbook .*: save its sheet as \.csv"):
        mpucal.load(tmp_path / "walk.xlsx")


def test_a_workbook_without_samples_is_refused(tmp_path):
    write(tmp_path / "notes.xlsx", [("a", "b")])
    with pytest.raises(RecordingError, match="names no columns of an accelerometer"):
        mpucal.load(tmp_path / "notes.xlsx")
    with zipfile.ZipFile(tmp_path / "none.xlsx", "w"):
        pass
    with pytest.raises(RecordingError, match=r"holds no xl/worksheets/sheet1\.xml: save its sheet as \.csv"):
        mpucal.load(tmp_path / "none.xlsx")
