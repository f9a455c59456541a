"""Names of a session's files: numbered, and known again."""

import pytest

from mpucal.errors import OutputError
from mpucal.result.session_files import CAPTURE
from mpucal.session.results import save


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
