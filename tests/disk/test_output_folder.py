"""A folder that is written to belongs to one process, and is found under its new name."""

import os
import sys
from pathlib import Path

import pytest

from mpucal.disk.output_folder import OutputFolder, free_name
from mpucal.errors import OutputError


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="others do not tell who has a lock")
def test_a_folder_in_use_is_refused_with_the_process_that_uses_it(tmp_path):
    with OutputFolder(tmp_path / "board"), pytest.raises(OutputError, match=rf"\(process {os.getpid()}\)"):
        OutputFolder(tmp_path / "board")
    with OutputFolder(tmp_path / "board") as again:
        assert again.path == tmp_path / "board"


def test_another_folder_is_suggested_only_where_it_will_do(tmp_path):
    for only, suggests in ((False, f"-o {tmp_path / 'board-2'}"), (True, "")):
        with OutputFolder(tmp_path / "board"), pytest.raises(OutputError) as refused:
            OutputFolder(tmp_path / "board", only=only)
        assert refused.value.options == suggests
        assert ("-o" in refused.value.remedy) is not only


def test_new_folders_have_names_of_their_own(tmp_path):
    folders = [OutputFolder(tmp_path / "board", new=True) for _ in range(3)]
    assert [folder.path.name for folder in folders] == ["board", "board-2", "board-3"]
    for folder in folders:
        (folder.path / "capture").touch()
        folder.rename(str(tmp_path / "mpu6050"))
        folder.close()
    assert {path.name for path in tmp_path.iterdir()} == {"mpu6050", "mpu6050-2", "mpu6050-3"}
    assert free_name(tmp_path / "mpu6050") == tmp_path / "mpu6050-4"


def test_a_free_name_beside_the_present_folder_and_the_one_above_is_theirs_with_a_number(tmp_path, monkeypatch):
    (tmp_path / "board" / "parts").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "board" / "parts")
    assert [free_name(Path(here)) for here in (".", "..")] == [tmp_path / "board" / "parts-2", tmp_path / "board-2"]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="others do not tell where a folder went")
def test_a_renamed_folder_is_followed_and_a_replaced_one_is_refused(tmp_path):
    with OutputFolder(tmp_path / "board") as folder:
        (tmp_path / "board").rename(tmp_path / "seven")
        (tmp_path / "board").mkdir()
        assert folder.path == tmp_path / "seven"
        (tmp_path / "seven").rmdir()
        with pytest.raises(OutputError, match="removed or replaced"):
            _ = folder.path


def test_a_new_folder_that_stays_empty_is_removed(tmp_path):
    (tmp_path / "there").mkdir()
    for name in ("there", "made", "filled"):
        with OutputFolder(tmp_path / name) as folder:
            if name == "filled":
                (folder.path / "capture").touch()
    assert {path.name for path in tmp_path.iterdir()} == {"there", "filled"}


def test_a_file_in_its_place_is_an_output_error(tmp_path):
    (tmp_path / "board").touch()
    with pytest.raises(OutputError, match="cannot make the folder"):
        OutputFolder(tmp_path / "board")
