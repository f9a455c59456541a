"""Cells as exact numbers: each spelling of one moment is that moment."""

from datetime import UTC, datetime
from decimal import Decimal

import pytest

from mpucal.files.tables.cells import is_number, parse_cell

OF_DAY = Decimal("43384.125") * 10**9
WITHOUT_ZONE = (datetime(2024, 5, 1) - datetime.min).days * 86400 * 10**9 + OF_DAY
WITH_ZONE = Decimal(int(datetime(2024, 5, 1, tzinfo=UTC).timestamp()) * 10**9) + OF_DAY
SPELLED = {
    OF_DAY: ("12:03:04.125", "12:03:04,125", "12:03:04:125", "12:03:04.125 PM", "0 days 12:03:04.125"),
    OF_DAY - 12 * 3600 * 10**9: ("00:03:04.125", "12:03:04.125 am", "03:04.125"),
    OF_DAY + 86400 * 10**9: ("1 days 12:03:04.125",),
    WITHOUT_ZONE: (
        *("2024-05-01 12:03:04.125", "2024-05-01T12:03:04,125", "2024/05/01 12:03:04.125", "1.5.2024 12:03:04,125"),
        *("01.05.2024, 12:03:04.125", "5/1/2024 12:03:04.125 p.m.", "01-May-2024 12:03:04.125"),
    ),
    WITH_ZONE: ("2024-05-01T12:03:04.125Z", "2024-05-01 12:03:04.125 UTC", "2024-05-01 14:03:04.125+02:00"),
    WITHOUT_ZONE + 30 * 86400 * 10**9: ("31/05/2024 12:03:04.125", "05/31/2024 12:03:04.125"),
    Decimal("-1.5"): ("-1.5", "-1,5", " -15e-1 "),
}


@pytest.mark.parametrize(("text", "found"), [(text, found) for found, texts in SPELLED.items() for text in texts])
def test_each_spelling_is_its_number(text, found):
    assert parse_cell(text) == found
    assert is_number(text, dates=False) == (found == Decimal("-1.5"))


@pytest.mark.parametrize("text", ["", "nan", "1e999", "12:3", "32.13.2024 12:03:04", "1.1.2024 " * 2000, "a", "1.2.3"])
def test_cells_without_a_number(text):
    assert not is_number(text)
