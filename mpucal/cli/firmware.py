"""`mpucal firmware`: write the serial bridge's firmware, as an Arduino library or onto a board."""

from __future__ import annotations

import shlex
import shutil
import subprocess
from contextlib import ExitStack
from pathlib import Path

import click

from ..errors import OutputError, SourceError, UsageError, WriteBackError
from .common import output_option

EXAMPLE = "Example: `mpucal firmware -o libraries/mpucal` writes the library into a sketchbook."
FOLDER = Path(__file__).parent.parent / "firmware"
LIBRARY = ("src", "examples", "library.properties", "library.json", "keywords.txt", "README.md")
HEX = "mpucal_bridge.hex"
LICENCE = "LICENSE"
# Boards with an ATmega328P at 16 MHz, for which there is an image, and the baud rate of their boot loader.
BAUDS = {"uno": 115_200, "nano": 115_200, "nano-old": 57_600}


@click.command("firmware", epilog=EXAMPLE)
@output_option("folder", "DIR", "Write the Arduino library to this folder.")
@click.option("--flash", "port", metavar="PORT", help="Write the bridge onto the board on this serial port.")
@click.option("--board", type=click.Choice(list(BAUDS)), default="uno", show_default=True, help="Board on PORT.")
def command(folder: Path | None, port: str | None, board: str) -> None:
    """Write the serial bridge's firmware: as a library for the Arduino IDE, or onto a board.

    An Uno or Nano is flashed by avrdude with an image that comes with mpucal. For other boards, the Arduino IDE or
    arduino-cli builds the library's sketch.
    """
    if (folder is None) == (port is None):
        raise UsageError("`mpucal firmware` takes one of -o DIR and --flash PORT", "give one of them")
    if folder is not None:
        _write(folder)
        click.echo(f"{folder}: put it into the folder `libraries` of your sketchbook; its sketch is mpucal_bridge.")
    elif port is not None:
        _flash(port, board)
        click.echo(f"The bridge is on the board; try `mpucal doctor --serial {port}`.")


def _library() -> Path:
    if not (FOLDER / "library.properties").is_file():
        raise SourceError("this installation of mpucal has no firmware", "install it again")
    return FOLDER


def _write(folder: Path) -> None:
    source = _library()
    with ExitStack() as on_failure:
        try:
            folder.mkdir(parents=True)
            on_failure.callback(shutil.rmtree, folder, ignore_errors=True)
            for name in LIBRARY:
                copy = shutil.copytree if (source / name).is_dir() else shutil.copyfile
                copy(source / name, folder / name)
            # A checkout has one licence for all, at its top.
            licences = (source / LICENCE, source.parents[1] / LICENCE)
            shutil.copyfile(next(filter(Path.is_file, licences), licences[0]), folder / LICENCE)
            on_failure.pop_all()
        except FileExistsError as error:
            raise OutputError(f"{folder} is there already", "choose another folder with -o") from error
        except OSError as error:
            # copytree raises a list of (source, target, text of the error).
            what = error.strerror or error.args[0][0][2].partition(": ")[0]
            raise OutputError(f"cannot write {folder} ({what})", "choose another folder with -o") from error


def _flash(port: str, board: str) -> None:
    source = _library()
    image = next((path for path in (source / HEX, source / "build" / HEX) if path.is_file()), None)
    if image is None:
        raise SourceError("this installation of mpucal has no image of the bridge", "build it: `make firmware`")
    words = ["avrdude", "-p", "atmega328p", "-c", "arduino", "-b", str(BAUDS[board]), "-P", port, "-D"]
    words += ["-U", f"flash:w:{image}:i"]
    if shutil.which(words[0]) is None:
        raise SourceError(f"{words[0]} is not installed", f"install it, then: {shlex.join(words)}")
    if subprocess.run(words, check=False).returncode:
        raise WriteBackError(
            f"{words[0]} could not write to the board on {port}",
            "check that nothing else uses the port, and --board: an old Nano needs nano-old",
        )
