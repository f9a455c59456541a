"""Pictures of a session's screen, from tmux, and of a report as a browser shows it; PNGs need a Chromium.

python -m tools.make pictures --output /tmp/screens                        80x24, at three times of a session
python -m tools.make pictures --output /tmp/screens --size 160x50          another size
python -m tools.make pictures --output /tmp/pictures board7/report.html    on a desk and a phone, in light and dark
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from html import escape
from pathlib import Path
from typing import Annotated

from rich.console import CONSOLE_SVG_FORMAT, Console
from rich.terminal_theme import MONOKAI
from rich.text import Text

FORMAT = re.sub(r"@font-face \{\{.*?\}\}", "", CONSOLE_SVG_FORMAT, flags=re.DOTALL)
BUS = "sim:pace=real,seed=3"
FLAGS = ("headless", "no-sandbox", "disable-gpu", "disable-background-networking", "disable-sync", "no-first-run")
# a window has a minimum width, a frame has none
FRAME = (
    '<body style="margin:0"><iframe style="border:0;width:{width}px;height:{height}px" srcdoc="{page}"></iframe></body>'
)
WIDTHS = {"desk": 1000, "phone": 375}
LEAST_WIDTH, HEIGHT = 500, 5600
DARK = "@media screen and (prefers-color-scheme: dark)"


def chromium() -> str | None:
    """Return the path of a Chromium, if there is one; the headless shell is twice as fast."""
    return next(filter(None, map(shutil.which, ("chromium-headless-shell", "chromium", "google-chrome"))), None)


def picture(browser: str, page: str, target: Path, width: int, height: int) -> None:
    """Write a PNG of the page at a URL, in a window of this size."""
    with tempfile.TemporaryDirectory() as profile:
        options = [*FLAGS, "hide-scrollbars", f"user-data-dir={profile}", f"window-size={width},{height}"]
        words = [browser, *(f"--{option}" for option in options), f"--screenshot={target}", page]
        subprocess.run(words, capture_output=True, check=True, timeout=120)


class Tmux:
    """A terminal of a given size, in a server of its own."""

    def __init__(self, columns: int, rows: int, words: list[str]) -> None:
        self._socket = f"mpucal-{os.getpid()}"
        self._tmux("new-session", "-d", "-x", str(columns), "-y", str(rows), shlex.join(words) + "; sleep 9")

    def text(self, colours: bool) -> str:
        """Return the text of the terminal, with or without escape codes for colours."""
        return self._tmux("capture-pane", "-p", *(["-e"] if colours else []))

    def close(self) -> None:
        """End the terminal and the program in it."""
        self._tmux("kill-server")

    def _tmux(self, *words: str) -> str:
        done = subprocess.run(["tmux", "-L", self._socket, *words], capture_output=True, text=True, check=True)
        return done.stdout


def drawing(ansi: str, columns: int, title: str) -> str:
    """Return the text as SVG, each character in its cell, without external fonts."""
    with Path(os.devnull).open("w") as nowhere:
        console = Console(record=True, width=columns, file=nowhere, force_terminal=True)
        console.print(Text.from_ansi(ansi))
        return console.export_svg(title=title, theme=MONOKAI, code_format=FORMAT)


def screen(folder: Path, size: str, at_s: str) -> None:
    """Run a simulated session, and take pictures of its screen at the given times."""
    columns, rows = (int(number) for number in size.split("x"))
    browser = chromium()
    with tempfile.TemporaryDirectory() as results:
        command = [sys.executable, "-m", "mpucal", "session", "--bus", BUS]
        tmux = Tmux(columns, rows, [*command, "-o", f"{results}/board"])
        begun = time.monotonic()
        try:
            for at in map(float, at_s.split(",")):
                time.sleep(max(begun + at - time.monotonic(), 0.0))
                svg = folder / f"{size}-{at:g}s.svg"
                svg.write_text(drawing(tmux.text(colours=True), columns, "mpucal session"), encoding="utf-8")
                svg.with_suffix(".txt").write_text(tmux.text(colours=False), encoding="utf-8")
                if browser is not None:
                    picture(browser, svg.as_uri(), svg.with_suffix(".png"), 13 * columns, 25 * rows + 150)
                print(svg)
        finally:
            tmux.close()


def of_report(browser: str, file: Path, folder: Path) -> None:
    """Take pictures of a report in each width and light."""
    light = file.read_text(encoding="utf-8")
    for place, width in WIDTHS.items():
        # replaces the media query of dark colours, which this browser cannot be given
        for name, page in (("light", light), ("dark", light.replace(DARK, "@media all"))):
            target = folder / f"{place}-{name}.png"
            with tempfile.TemporaryDirectory() as place_of_frame:
                frame = Path(place_of_frame) / "frame.html"
                frame.write_text(FRAME.format(width=width, height=HEIGHT, page=escape(page)), encoding="utf-8")
                picture(browser, frame.as_uri(), target, max(width, LEAST_WIDTH), HEIGHT)
            print(target)


def main(
    report: Annotated[Path | None, "a report, in place of a session"] = None,
    *,
    output: Annotated[Path, "folder of the pictures"],
    size: Annotated[str, "columns x rows"] = "80x24",
    at: Annotated[str, "after how many seconds pictures are taken"] = "8,30,45",
) -> int:
    """Take all pictures."""
    folder = output.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    if report is None:
        screen(folder, size, at)
    elif (browser := chromium()) is None:
        print("there is no Chromium here: install one, or open the report in your browser", file=sys.stderr)
        return 1
    else:
        of_report(browser, report, folder)
    return 0
