"""`mpucal firmware`: the bridge as an Arduino library, or onto a board."""

from __future__ import annotations

import shlex
import shutil
import subprocess
from pathlib import Path

import click

from ..errors import OutputError, SourceError, UsageError, WriteBackError

EXAMPLE = "Example: `mpucal firmware -o libraries/mpucal` writes the library into a sketchbook."
PACKAGE = Path(__file__).parents[1]
# where an installation keeps it, and where a checkout does
FOLDERS = (PACKAGE / "firmware", PACKAGE.parent / "tools" / "firmware")
LIBRARY = ("src", "examples", "library.properties", "library.json", "keywords.txt", "README.md")
HEX = "mpucal_bridge.hex"
# boards with an ATmega328P at 16 MHz, and the rate of their boot loader
BOARDS = {"uno": 115_200, "nano": 115_200, "nano-old": 57_600}


@click.command("firmware", epilog=EXAMPLE)
@click.option("-o", "folder", metavar="DIR", type=click.Path(path_type=Path), help="Write the Arduino library here.")
@click.option("--flash", "port", metavar="PORT", help="Write the bridge onto the board on this serial port.")
@click.option("--board", type=click.Choice(list(BOARDS)), default="uno", show_default=True, help="What is on PORT.")
def command(folder: Path | None, port: str | None, board: str) -> None:
    """Write the serial bridge's firmware: as a library for the Arduino IDE, or onto an Uno or Nano, by avrdude."""
    if (folder is None) == (port is None):
        raise UsageError("`mpucal firmware` takes one of -o DIR and --flash PORT", "give one of them")
    if folder is not None:
        _write(folder)
        click.echo(f"{folder}: put it into the folder `libraries` of your sketchbook; its sketch is mpucal_bridge.")
    elif port is not None:
        _flash(port, board)
        click.echo(f"The bridge is on the board; try `mpucal doctor --serial {port}`.")


def _source() -> Path:
    found = next((each for each in FOLDERS if (each / "library.properties").is_file()), None)
    if found is None:
        raise SourceError("this installation of mpucal holds no firmware", "install it again, or take tools/firmware")
    return found


def _write(folder: Path) -> None:
    source = _source()
    try:
        folder.mkdir(parents=True)
        for name in LIBRARY:
            copy = shutil.copytree if (source / name).is_dir() else shutil.copyfile
            copy(source / name, folder / name)
    except FileExistsError as error:
        raise OutputError(f"{folder} is there already", "choose another folder with -o") from error
    except OSError as error:
        raise OutputError(f"cannot write {folder} ({error.strerror})", "choose another folder with -o") from error


def _flash(port: str, board: str) -> None:
    source = _source()
    image = next((path for path in (source / HEX, source / "build" / HEX) if path.is_file()), None)
    if image is None:
        raise SourceError("this installation of mpucal holds no image of the bridge", "make it: `make firmware`")
    upload = f"flash:w:{image}:i"
    words = ["avrdude", "-p", "atmega328p", "-c", "arduino", "-b", str(BOARDS[board]), "-P", port, "-D", "-U", upload]
    if shutil.which(words[0]) is None:
        raise SourceError("there is no avrdude to write it with", f"install it, then: {shlex.join(words)}")
    if subprocess.run(words, check=False).returncode:
        raise WriteBackError(
            f"avrdude could not write to the board on {port}",
            "check that nothing else uses the port; an old Nano needs --board nano-old",
        )
