"""The table of a session's files: their numbered names, and its copy in docs/session.md."""

import re
from pathlib import Path

import pytest

from mpucal.errors import OutputError
from mpucal.result.session_files import CAPTURE, SESSION_FILES
from mpucal.session.results import save
from mpucal.sinks.table import SINKS

PAGE = Path(__file__).parents[2] / "docs" / "session.md"


def test_the_page_has_the_same_rows():
    section = re.search(r"## What a session leaves\n(.*)", PAGE.read_text(encoding="utf-8"), re.DOTALL)[1]
    rows = re.findall(r"^\| `(.+?)` \| (.+) \|$", section, re.MULTILINE)
    left = [*SESSION_FILES, *(file for kind in SINKS.values() for file in kind.session_files)]
    assert rows == [(file.name, file.what.replace("](firm", "](../firm")) for file in left]


def test_each_one_is_free_until_it_is_there(tmp_path):
    names = []
    for _ in range(3):
        path = CAPTURE.free_in(tmp_path)
        path.write_bytes(b"")
        names.append(path.name)
    assert names == ["capture.mcap", "capture-2.mcap", "capture-3.mcap"]
    assert names == [CAPTURE.numbered(number) for number in (1, 2, 3)]
    assert all(map(CAPTURE.matches, names))


@pytest.mark.parametrize("name", ["capture.tlog", "capture-.mcap", "capture-x.mcap", "my-capture.mcap", "captureXmcap"])
def test_another_file_is_none(name):
    assert not CAPTURE.matches(name)


def test_a_report_that_does_not_fit_costs_nothing_else(tmp_path):
    (tmp_path / "report.html").mkdir()
    files = {"calibration.json": b"{}", "calibration.bin": b"blob", "report.html": b"page"}
    with pytest.raises(OutputError, match=r"calibration.bin and calibration.json are kept in .* -o ELSEWHERE"):
        save(tmp_path, files)
    assert (tmp_path / "calibration.json").read_bytes() == b"{}"
    assert (tmp_path / "calibration.bin").read_bytes() == b"blob"
