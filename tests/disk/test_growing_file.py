"""A capture is synced to the disk whole, at last."""

import os
import sys
from functools import partial

import pytest

from mpucal.chip.access import Transaction
from mpucal.disk.atomic import check_free
from mpucal.disk.growing_file import GrowingFile
from mpucal.errors import OutputError
from mpucal.files.capture_writer import CaptureWriter


def test_a_capture_is_on_the_disk_once_it_is_closed(tmp_path, monkeypatch):
    synced = {}

    def watched(sync, handle):
        status = os.fstat(handle)
        synced[status.st_ino] = status.st_size
        sync(handle)

    for name in ("fdatasync", "fsync"):  # the second for a capture that is rewritten with its index
        monkeypatch.setattr(os, name, partial(watched, getattr(os, name)))
    path = tmp_path / "capture.mcap"
    with CaptureWriter(path) as writer:
        writer.start({})
        writer.transaction(Transaction("read", 0x75, 1, b"\x68", 5))
    status = path.stat()
    assert synced[status.st_ino] == status.st_size > 0


@pytest.mark.parametrize("make", [lambda path: path.write_bytes(b"other"), lambda path: path.symlink_to("nothing")])
def test_an_existing_file_is_not_replaced(tmp_path, make):
    make(path := tmp_path / "capture.mcap")
    with pytest.raises(OutputError, match="exists already"):
        check_free(path)
    with pytest.raises(OutputError, match="File exists"):
        GrowingFile(path)


@pytest.mark.parametrize(
    ("meddle", "what"),
    [
        (lambda path: os.truncate(path, 3), "shortened or overwritten"),
        (lambda path: path.unlink(), "removed or replaced"),
        (lambda path: path.unlink() or path.write_bytes(b"bytes, more"), "removed or replaced"),
    ],
    ids=["shortened", "removed", "replaced"],
)
def test_a_file_that_another_program_changes_is_reported(tmp_path, meddle, what):
    file = GrowingFile(tmp_path / "capture.mcap")
    file.write(b"bytes")
    file.flush()
    meddle(file.path)
    file.write(b", more")
    with pytest.raises(OutputError, match=what):
        file.close()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="others do not tell where a file went")
def test_a_file_in_a_renamed_folder_is_found(tmp_path):
    (tmp_path / "board").mkdir()
    file = GrowingFile(tmp_path / "board" / "capture.mcap")
    file.write(b"bytes")
    (tmp_path / "board").rename(tmp_path / "seven")
    assert file.close() == tmp_path / "seven" / "capture.mcap"
