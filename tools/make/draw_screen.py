"""Pictures of a session's screen, from tmux: as text and SVG (as PNG too, where there is a Chromium).

python -m tools.make draw_screen -o /tmp/screens                        80x24, at three times of a simulated session
python -m tools.make draw_screen -o /tmp/screens --size 160x50          another size
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from rich.console import CONSOLE_SVG_FORMAT, Console
from rich.terminal_theme import MONOKAI
from rich.text import Text

from .browser import chromium, picture

FORMAT = re.sub(r"@font-face \{\{.*?\}\}", "", CONSOLE_SVG_FORMAT, flags=re.DOTALL)

BUS = "sim:pace=real,seed=3"


class Tmux:
    """One terminal of a given size, in a server of its own."""

    def __init__(self, columns: int, rows: int, words: list[str]) -> None:
        self._socket = f"mpucal-{os.getpid()}"
        self._tmux("new-session", "-d", "-x", str(columns), "-y", str(rows), shlex.join(words) + "; sleep 9")

    def text(self, colours: bool) -> str:
        """What is on it, with escape codes for its colours or without."""
        return self._tmux("capture-pane", "-p", *(["-e"] if colours else []))

    def close(self) -> None:
        """End it, and what runs in it."""
        self._tmux("kill-server")

    def _tmux(self, *words: str) -> str:
        done = subprocess.run(["tmux", "-L", self._socket, *words], capture_output=True, text=True, check=True)
        return done.stdout


def drawing(ansi: str, columns: int, title: str) -> str:
    """The same as SVG, every character in its cell and no font from elsewhere."""
    with Path(os.devnull).open("w") as nowhere:
        console = Console(record=True, width=columns, file=nowhere, force_terminal=True)
        console.print(Text.from_ansi(ansi))
        return console.export_svg(title=title, theme=MONOKAI, code_format=FORMAT)


def main() -> int:
    """Run a session, and take its pictures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="where the pictures go")
    parser.add_argument("--size", default="80x24", help="columns x rows")
    parser.add_argument("--at", default="8,30,45", help="after how many seconds pictures are taken")
    arguments = parser.parse_args()
    columns, rows = (int(number) for number in arguments.size.split("x"))
    folder = arguments.output.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    browser = chromium()
    with tempfile.TemporaryDirectory() as results:
        command = [sys.executable, "-m", "mpucal", "session", "--bus", BUS]
        tmux = Tmux(columns, rows, [*command, "-o", f"{results}/board"])
        begun = time.monotonic()
        try:
            for at in map(float, arguments.at.split(",")):
                time.sleep(max(begun + at - time.monotonic(), 0.0))
                name = f"{arguments.size}-{at:g}s"
                svg = folder / f"{name}.svg"
                svg.write_text(drawing(tmux.text(colours=True), columns, "mpucal session"), encoding="utf-8")
                svg.with_suffix(".txt").write_text(tmux.text(colours=False), encoding="utf-8")
                if browser is not None:
                    picture(browser, svg.as_uri(), svg.with_suffix(".png"), 13 * columns, 25 * rows + 150)
                print(svg)
        finally:
            tmux.close()
    return 0
