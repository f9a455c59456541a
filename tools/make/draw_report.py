"""Pictures of a report as a browser shows it: on a desk and on a phone, in light and dark. Needs a Chromium.

python -m tools.make draw_report board7/report.html -o /tmp/pictures
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from html import escape
from pathlib import Path

FLAGS = ("--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-sync")
# a window has a least width, a frame has none
FRAME = (
    '<body style="margin:0"><iframe style="border:0;width:{width}px;height:{height}px" srcdoc="{page}"></iframe></body>'
)
WIDTHS = {"desk": 1000, "phone": 375}
HEIGHT = 5600
DARK = "@media screen and (prefers-color-scheme: dark)"


def picture(browser: str, page: str, width: int, target: Path) -> None:
    """One picture of a page."""
    with tempfile.TemporaryDirectory() as folder:
        frame = Path(folder) / "frame.html"
        frame.write_text(FRAME.format(width=width, height=HEIGHT, page=escape(page)), encoding="utf-8")
        window = f"--window-size={max(width, 500)},{HEIGHT}"
        words = [browser, *FLAGS, "--no-first-run", "--hide-scrollbars", f"--user-data-dir={folder}/profile", window]
        subprocess.run([*words, f"--screenshot={target}", frame.as_uri()], capture_output=True, check=True, timeout=120)


def main() -> int:
    """Take all of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("report", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="where the pictures go")
    arguments = parser.parse_args()
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        print("there is no Chromium here: install one, or open the report in your browser", file=sys.stderr)
        return 1
    light = arguments.report.read_text(encoding="utf-8")
    arguments.output.mkdir(parents=True, exist_ok=True)
    for place, width in WIDTHS.items():
        # the night's colours by day, as the browser here cannot be told what time it is
        for time, page in (("light", light), ("dark", light.replace(DARK, "@media all"))):
            target = arguments.output.resolve() / f"{place}-{time}.png"
            picture(browser, page, width, target)
            print(target)
    return 0
