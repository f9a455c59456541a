"""What tests of several rooms write."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import pytest

from mpucal.session.threads import ONE_THREAD

os.environ.update(ONE_THREAD)  # as the program does, and before NumPy or SciPy loads
# notes of writes belong to no home
os.environ["XDG_STATE_HOME"] = tempfile.mkdtemp(prefix="mpucal-state-")

from mpucal.files import open_writer
from mpucal.files.rows import Rows


@pytest.fixture(scope="session")
def save():
    """Write a recording into a file, in the format of its suffix."""

    def call(recording, path):
        rows = Rows.of(recording)
        with open_writer(Path(path), rows, "") as write:
            for samples in rows.runs:
                write(samples)

    return call
