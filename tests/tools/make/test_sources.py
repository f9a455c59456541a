"""The page of the sources, made from their table."""

import pytest

from mpucal.sources.table import SOURCES
from tools.make import sources as made


def test_the_page_is_the_tables():
    assert made.PAGE.read_text(encoding="utf-8") == made.page(), "run tools/make/sources.py"


@pytest.mark.parametrize("kind", SOURCES, ids=lambda kind: kind.spelled)
def test_a_row_says_what_the_table_says(kind):
    (row,) = (line for line in made.page().splitlines() if line.startswith(f"| `{kind.spelled}` |"))
    assert all(f"`{option.spelled}`" in row for option in (*kind.options, *kind.settings))
    assert ("`doctor`" in row) == bool(kind.doctor)
