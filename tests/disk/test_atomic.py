import os
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.disk.atomic import remove_file, write_atomically, write_together
from mpucal.errors import OutputError


class Failing:
    """The system's calls that make it, bring it to the disk, and give it its rights and name; number `at` fails."""

    def __init__(self, at, patch):
        self.at, self.count = at, 0
        steps = ((Path, "open"), (os, "open"), (Path, "chmod"), (Path, "replace"))
        for module, name in steps:
            patch.setattr(module, name, self.counted(getattr(module, name)))
        patch.setattr(os, "fsync", self.counted(lambda _handle: None))

    def counted(self, call):
        def step(*words, **named):
            self.count += 1
            if self.count == self.at:
                raise OSError(28, "No space left on device")
            return call(*words, **named)

        return step


@settings(max_examples=40)
@given(at=st.integers(1, 8), there_before=st.booleans())
def test_a_fault_at_any_step_leaves_the_old_file_or_the_new_one(tmp_path_factory, at, there_before):
    path = tmp_path_factory.mktemp("faults") / "a.json"
    if there_before:
        write_atomically(path, b"old")
    with pytest.MonkeyPatch.context() as patch:
        Failing(at, patch)
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
    assert new == (at > (4 if there_before else 3))
    assert [p.name for p in path.parent.iterdir()] == (["a.json"] if path.exists() else [])


@settings(max_examples=40)
@given(at=st.integers(1, 25), there_before=st.sets(st.sampled_from("abc")))
def test_a_fault_at_any_step_leaves_all_old_files_or_all_new_ones(tmp_path_factory, at, there_before):
    folder = tmp_path_factory.mktemp("faults")
    for name in there_before:
        write_atomically(folder / name, b"old")
    with pytest.MonkeyPatch.context() as patch:
        Failing(at, patch)
        try:
            write_together({folder / name: name.encode() for name in "abc"})
        except OutputError:
            expected = dict.fromkeys(there_before, b"old")
        else:
            expected = {name: name.encode() for name in "abc"}
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == expected


@pytest.mark.parametrize(
    ("name", "says"), [("none/a.json", r"none/a\.json.*No such file"), ("there", "Is a directory")]
)
def test_a_place_where_no_file_can_be_is_named(tmp_path, name, says):
    (tmp_path / "there").mkdir()
    with pytest.raises(OutputError, match=says) as raised:
        write_atomically(tmp_path / name, b"")
    assert "-o" in raised.value.remedy
    assert [p.name for p in tmp_path.iterdir()] == ["there"]


def test_a_new_file_has_the_rights_of_the_umask_and_an_old_one_keeps_its_own(tmp_path):
    kept = tmp_path / "kept.json"
    kept.touch(0o640)
    kept.chmod(0o640)
    before = os.umask(0o077)
    try:
        for path in (tmp_path / "new.json", kept):
            write_atomically(path, b"{}")
    finally:
        os.umask(before)
    assert [path.stat().st_mode & 0o777 for path in (tmp_path / "new.json", kept)] == [0o600, 0o640]


@pytest.mark.parametrize(
    ("make", "what"),
    [
        (lambda path: path.symlink_to("other"), "is a link"),
        (lambda path: path.symlink_to("nothing"), "is a link"),
        (os.mkfifo, "is a device or pipe"),
    ],
    ids=["link", "link to nothing", "pipe"],
)
def test_links_devices_and_folders_are_never_replaced(tmp_path, make, what):
    (tmp_path / "other").write_bytes(b"other")
    path = tmp_path / "a.json"
    make(path)
    was = path.lstat()
    for write in (lambda: write_atomically(path, b"new"), lambda: write_together({path: b"new"})):
        with pytest.raises(OutputError, match=what):
            write()
    remove_file(path)
    assert os.path.samestat(path.lstat(), was)
    assert (tmp_path / "other").read_bytes() == b"other"
    assert {each.name for each in tmp_path.iterdir()} == {"other", "a.json"}
