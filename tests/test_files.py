import os
import tempfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpucal.errors import OutputError
from mpucal.files import write_atomically


def test_writes_a_new_file_and_replaces_an_old_one(tmp_path):
    path = tmp_path / "a.json"
    for content in (b"first", b"second, longer", b""):
        write_atomically(path, content)
        assert path.read_bytes() == content
    assert [p.name for p in tmp_path.iterdir()] == ["a.json"]
    assert path.stat().st_mode & 0o777 == 0o644


class Failing:
    """Calls of the system, counted; call number `at` fails."""

    def __init__(self, at):
        self.at, self.count = at, 0

    def __call__(self, call):
        def counted(*words, **named):
            self.count += 1
            if self.count == self.at:
                raise OSError(28, "No space left on device")
            return call(*words, **named)

        return counted


@given(at=st.integers(1, 8), there_before=st.booleans())
def test_a_fault_at_any_step_leaves_the_old_file_or_the_new_one(tmp_path_factory, at, there_before):
    path = tmp_path_factory.mktemp("faults") / "a.json"
    if there_before:
        write_atomically(path, b"old")
    failing = Failing(at)
    with pytest.MonkeyPatch.context() as patch:
        # make it (which opens it), its way to the disk, its rights, its name, and the folder on its way to the disk
        steps = ((tempfile, "NamedTemporaryFile"), (os, "fsync"), (os, "open"), (Path, "chmod"), (Path, "replace"))
        for module, name in steps:
            patch.setattr(module, name, failing(getattr(module, name)))
        try:
            write_atomically(path, b"new")
        except OutputError as error:
            assert error.exit_code == 3
            assert "No space left on device" in error.what
            new = False
        else:
            new = True
    held = path.read_bytes() if path.exists() else None
    assert held == (b"new" if new else b"old" if there_before else None)
    # beyond the last step nothing fails, and a folder that was not synced holds the new file
    assert new == (at > 5)
    assert [p.name for p in path.parent.iterdir()] == (["a.json"] if path.exists() else [])


def test_a_folder_that_is_not_there_is_named(tmp_path):
    with pytest.raises(OutputError, match=r"none/a\.json.*No such file") as raised:
        write_atomically(tmp_path / "none" / "a.json", b"")
    assert "-o" in raised.value.remedy


def test_a_folder_in_the_files_place_is_an_output_error(tmp_path):
    (tmp_path / "a.json").mkdir()
    with pytest.raises(OutputError, match="Is a directory"):
        write_atomically(tmp_path / "a.json", b"")
    assert [p.name for p in tmp_path.iterdir()] == ["a.json"]
