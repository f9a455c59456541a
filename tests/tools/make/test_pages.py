"""The pages and drawings of docs/ are those of the tables and imports that they are made from."""

import pytest

from mpucal.sources.table import SOURCES
from tools.make import pages, sources


def test_what_is_made_is_made_anew():
    assert not list(pages.outdated()), "run `python -m tools.make pages`"


@pytest.mark.parametrize("kind", SOURCES, ids=lambda kind: kind.flag)
def test_a_row_says_what_the_table_says(kind):
    (row,) = (line for line in sources.page("").splitlines() if line.startswith(f"| `{kind.flag}` |"))
    assert all(f"`{option.flag}`" in row for option in (*kind.options, *kind.settings))
    assert ("`doctor`" in row) == bool(kind.doctor)
