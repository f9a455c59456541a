"""The note of a write: gone after it, whatever the disk does."""

from pathlib import Path
from unittest.mock import patch

from mpucal.result.journal import Journal


def test_a_note_that_cannot_be_taken_away_counts_no_more(tmp_path):
    journal = Journal(tmp_path / "state" / "write.json")
    journal.begin({"old": {"A": 1.0}})
    assert journal.interrupted()["old"] == {"A": 1.0}
    with patch.object(Path, "unlink", side_effect=OSError("Input/output error")):
        journal.end()
    assert journal.interrupted() is None


def test_a_note_is_gone_after_the_write(tmp_path):
    journal = Journal(tmp_path / "write.json")
    journal.begin({"old": {}})
    journal.end()
    assert list(tmp_path.iterdir()) == []
