"""A capture reaches the disk: what was synced last is all of it."""

import os

import pytest

from mpucal.chip.access import Transaction
from mpucal.files.mcap import CaptureWriter
from mpucal.mavlink.tlog import TlogWriter


@pytest.mark.parametrize("kind", ["mcap", "tlog"])
def test_a_capture_is_on_the_disk_once_it_is_closed(tmp_path, monkeypatch, kind):
    synced = []
    sync = os.fdatasync
    monkeypatch.setattr(os, "fdatasync", lambda handle: synced.append(os.fstat(handle).st_size) or sync(handle))
    path = tmp_path / f"capture.{kind}"
    if kind == "mcap":
        with CaptureWriter(path) as writer:
            writer.start({})
            writer.transaction(Transaction("read", 0x75, 1, b"\x68", 5))
    else:
        with TlogWriter(path) as writer:
            writer.packet(1_000_000, b"packet")
    assert synced[-1] == path.stat().st_size > 0
