"""The Arduino library: it compiles with the stock options of each board, and says what Arduino's rules ask."""

import json
import re
import tomllib
from pathlib import Path
from urllib.parse import urlsplit

import pytest

FIRMWARE = Path(__file__).parents[2] / "mpucal" / "firmware"
# test_matrix.py compiles the sketches with the same core and more warnings, test_discovery.py finds the library
BOARDS = ("uno", "nano-atmega328old", "mega-atmega2560", "leonardo")
SKETCHES = ("mpucal_bridge", "mpucal_corrected")


@pytest.mark.slow
@pytest.mark.parametrize("board", BOARDS)
@pytest.mark.parametrize("sketch", SKETCHES)
def test_a_stock_ide_compiles_it_without_a_warning(stock_sketches, board, sketch):
    folder = stock_sketches(board)
    assert (folder / sketch / f"{sketch}.ino.hex").is_file()
    said = (folder / f"{sketch}.log").read_text().splitlines()
    # the core's own are not ours
    assert [line for line in said if "warning" in line and "/usr/share/arduino" not in line] == []


def test_both_package_managers_read_the_same():
    properties = dict(line.split("=", 1) for line in (FIRMWARE / "library.properties").read_text().splitlines())
    package = json.loads((FIRMWARE / "library.json").read_text())
    assert (properties["name"], properties["version"]) == (package["name"], package["version"])
    assert properties["category"] == "Sensors"
    # what the IDE takes no library without, and Library Manager none where it is empty or no URL
    for name in ("author", "maintainer", "sentence", "paragraph", "url"):
        assert properties[name]
    assert urlsplit(properties["url"]).scheme == "https"
    (author,) = tomllib.loads((FIRMWARE.parents[1] / "pyproject.toml").read_text())["project"]["authors"]
    assert properties["author"] == properties["maintainer"] == package["authors"]["name"] == author["name"]
    assert (FIRMWARE / "src" / properties["includes"]).is_file()


def test_the_keywords_are_in_the_headers():
    headers = "\n".join(path.read_text() for path in (FIRMWARE / "src").glob("*.h"))
    lines = (FIRMWARE / "keywords.txt").read_text().splitlines()
    assert lines
    for line in lines:
        word, kind = line.split("\t")
        assert re.fullmatch(r"KEYWORD[12]|LITERAL1", kind)
        assert re.search(rf"\b{word}\b", headers)
