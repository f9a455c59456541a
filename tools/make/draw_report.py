"""Pictures of a report as a browser shows it: on a desk and on a phone, in light and dark. Needs a Chromium.

python -m tools.make draw_report board7/report.html -o /tmp/pictures
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from html import escape
from pathlib import Path

from .browser import chromium, picture

# a window has a least width, a frame has none
FRAME = (
    '<body style="margin:0"><iframe style="border:0;width:{width}px;height:{height}px" srcdoc="{page}"></iframe></body>'
)
WIDTHS = {"desk": 1000, "phone": 375}
LEAST_WIDTH, HEIGHT = 500, 5600
DARK = "@media screen and (prefers-color-scheme: dark)"


def main() -> int:
    """Take all of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("report", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="where the pictures go")
    arguments = parser.parse_args()
    browser = chromium()
    if browser is None:
        print("there is no Chromium here: install one, or open the report in your browser", file=sys.stderr)
        return 1
    light = arguments.report.read_text(encoding="utf-8")
    arguments.output.mkdir(parents=True, exist_ok=True)
    for place, width in WIDTHS.items():
        # the night's colours by day, as the browser here cannot be told what time it is
        for time, page in (("light", light), ("dark", light.replace(DARK, "@media all"))):
            target = arguments.output.resolve() / f"{place}-{time}.png"
            with tempfile.TemporaryDirectory() as folder:
                frame = Path(folder) / "frame.html"
                frame.write_text(FRAME.format(width=width, height=HEIGHT, page=escape(page)), encoding="utf-8")
                picture(browser, frame.as_uri(), target, max(width, LEAST_WIDTH), HEIGHT)
            print(target)
    return 0
