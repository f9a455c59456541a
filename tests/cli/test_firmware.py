"""`mpucal firmware`: the library in a folder, and the board by avrdude."""

from pathlib import Path

import pytest

from mpucal.__main__ import run
from mpucal.cli import firmware

FIRMWARE = Path(__file__).parents[2] / "mpucal" / "firmware"


@pytest.fixture
def programs(tmp_path, monkeypatch):
    """A folder that is all of PATH."""
    folder = tmp_path / "bin"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))
    return folder


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """An installation with an image."""
    folder = tmp_path / "installed"
    folder.mkdir()
    (folder / "library.properties").write_text("name=mpucal\n")
    (folder / firmware.HEX).write_text(":00000001FF\n")
    monkeypatch.setattr(firmware, "FOLDER", folder)
    return folder


def program(folder, code, name="avrdude"):
    path = folder / name
    path.write_text(f'#!/bin/sh\necho "$@" > {folder}/said\nexit {code}\n')
    path.chmod(0o755)


def test_the_library_is_written_whole(tmp_path, capsys):
    folder = tmp_path / "libraries" / "mpucal"
    assert run(["firmware", "-o", str(folder)]) == 0
    for name in (*firmware.LIBRARY, firmware.LICENCE):
        assert (folder / name).exists()
    for path in FIRMWARE.glob("src/*"):
        assert (folder / "src" / path.name).read_bytes() == path.read_bytes()
    assert run(["firmware", "-o", str(folder)]) == 3
    assert "is there already" in capsys.readouterr().err


@pytest.mark.parametrize(("board", "baud"), [("uno", "115200"), ("nano-old", "57600")])
def test_avrdude_gets_the_image_and_the_port(installed, programs, board, baud):
    program(programs, 0)
    assert run(["firmware", "--flash", "/dev/ttyX", "--board", board]) == 0
    said = (programs / "said").read_text().split()
    assert said[said.index("-b") + 1] == baud
    assert said[said.index("-P") + 1] == "/dev/ttyX"
    assert said[-1] == f"flash:w:{installed / firmware.HEX}:i"


def test_a_failed_write_of_the_firmware_is_reported(installed, programs, capsys):
    program(programs, 1)
    assert run(["firmware", "--flash", "/dev/ttyX"]) == 6
    assert "could not write to the board on /dev/ttyX" in capsys.readouterr().err
