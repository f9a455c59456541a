"""Storage of a blob in a file of LittleFS, which loses power at every step."""

import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from mpucal.result.blob import Blob

HERE = Path(__file__).parent / "host" / "littlefs"
SOURCES = Path(__file__).parents[2] / "mpucal" / "firmware" / "src"
OLD = Path(__file__).parents[2] / "fixtures" / "vectors" / "blob_measured.bin"


@pytest.mark.parametrize("core", ["ESP32", pytest.param("ESP8266", marks=pytest.mark.slow)])
def test_a_loss_of_power_leaves_the_old_blob_or_the_new_one(core, tmp_path, need):
    """Format a flash without a file system only when a blob is stored."""
    need("gcc", "g++")
    (tmp_path / "new.bin").write_bytes(replace(Blob.decode(OLD.read_bytes()), b_a=(1.0, 2.0, 3.0)).encode())
    flags = ["-Wall", "-Wextra", "-Werror", f"-D{core}", f"-I{HERE}", f"-I{SOURCES}"]
    subprocess.run(["gcc", "-std=c99", *flags, "-c", SOURCES / "mpucal_slots.c"], cwd=tmp_path, check=True)
    main = ["g++", "-std=c++17", *flags, "-o", "main", HERE / "main.cpp", "mpucal_slots.o", "-lm"]
    subprocess.run(main, cwd=tmp_path, check=True)
    said = subprocess.run([tmp_path / "main", OLD, "new.bin"], cwd=tmp_path, capture_output=True, text=True, check=True)
    flash, *before, told, last = said.stdout.split()
    assert flash == "untouched"
    # two images are written, each in three steps
    assert (told, last, len(before)) == ("told", "new", 6)
    assert set(before) <= {"old", "new"}
