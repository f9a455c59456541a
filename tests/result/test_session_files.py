"""Files of a session: their names, what is kept where one does not fit, and the note of a write."""

from pathlib import Path
from unittest.mock import patch

import pytest

from mpucal.errors import OutputError
from mpucal.result.journal import Journal
from mpucal.result.session_files import CAPTURE
from mpucal.session.results import save


def test_a_capture_takes_the_first_free_name(tmp_path):
    names = []
    for _ in range(3):
        path = CAPTURE.free_in(tmp_path)
        path.write_bytes(b"")
        names.append(path.name)
    assert names == ["capture.mcap", "capture-2.mcap", "capture-3.mcap"]
    others = ["capture.tlog", "capture-.mcap", "capture-x.mcap", "my-capture.mcap", "captureXmcap"]
    assert list(filter(CAPTURE.matches, names + others)) == names


def test_a_report_that_does_not_fit_costs_nothing_else(tmp_path):
    (tmp_path / "report.html").mkdir()
    files = {"calibration.json": b"{}", "calibration.bin": b"blob", "report.html": b"page"}
    with pytest.raises(OutputError, match=r"calibration.bin and calibration.json are kept in .* -o ELSEWHERE"):
        save(tmp_path, files)
    assert (tmp_path / "calibration.json").read_bytes() == b"{}"
    assert (tmp_path / "calibration.bin").read_bytes() == b"blob"


@pytest.mark.parametrize("fails", [False, True], ids=["a good disk", "a bad disk"])
def test_the_note_of_a_write_counts_until_its_end(tmp_path, fails):
    journal = Journal(tmp_path / "state" / "write.json")
    journal.begin({"old": {"A": 1.0}})
    assert journal.interrupted()["old"] == {"A": 1.0}
    with patch.object(
        Path, "unlink", autospec=True, side_effect=OSError("Input/output error") if fails else Path.unlink
    ):
        journal.end()
    assert journal.interrupted() is None
    assert fails or list((tmp_path / "state").iterdir()) == []
