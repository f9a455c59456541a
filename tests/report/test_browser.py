"""The page in a real browser, at the width of a desk and of a phone."""

import json
import re
import shutil
import subprocess
from html import escape, unescape

import pytest

BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
FLAGS = ("--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-sync")
# a window has a least width, a frame has none; the frame tells what became of the page in it
FRAME = """<!DOCTYPE html><html><body style="margin:0">
<iframe style="border:0;width:{width}px;height:800px" srcdoc="{page}" onload="
  const page = this.contentDocument, root = page.documentElement;
  page.querySelectorAll('details').forEach(part => part.open = true);
  document.body.append(JSON.stringify({{
    wide: root.scrollWidth,
    pictures: [...page.querySelectorAll('svg')].map(svg => svg.getBoundingClientRect().width),
    sticking_out: [...page.querySelectorAll('p, li, figure, h1, h2, th')]
      .filter(e => e.getBoundingClientRect().right > {width} && !e.closest('.wide')).length,
    cut: [...page.querySelectorAll('#accelerometer td')]
      .filter(e => e.getBoundingClientRect().right > {width}).length,
    decided: Math.max(...[...page.querySelectorAll('#accelerometer, .first ul')]
      .map(e => e.getBoundingClientRect().bottom)),
    paper: getComputedStyle(page.body).backgroundColor,
    fetched: performance.getEntriesByType('resource').length }}));"></iframe></body></html>
"""


@pytest.fixture(scope="module")
def look(result, tmp_path_factory):
    """What a browser makes of the page at a width."""
    if BROWSER is None:
        pytest.skip("there is no Chromium here")

    def at(width):
        folder = tmp_path_factory.mktemp("browser")
        (folder / "frame.html").write_text(FRAME.format(width=width, page=escape(result.html)), encoding="utf-8")
        words = [BROWSER, *FLAGS, "--no-first-run", f"--user-data-dir={folder}", "--window-size=1400,900"]
        dom = subprocess.run(
            [*words, "--dump-dom", (folder / "frame.html").as_uri()], capture_output=True, text=True, check=True
        ).stdout
        return json.loads(unescape(re.search(r'\{"wide".*?\}', dom)[0]))

    return at


@pytest.mark.parametrize("width", [375, 1200], ids=["phone", "desk"])
def test_nothing_sticks_out_and_all_pictures_are_seen(look, width):
    seen = look(width)
    assert seen["wide"] <= width
    assert seen["sticking_out"] == seen["cut"] == 0
    assert len(seen["pictures"]) == 7
    assert all(300 < picture <= 640 for picture in seen["pictures"])
    assert seen["paper"] == "rgb(255, 255, 255)"
    assert seen["fetched"] == 0


def test_a_desk_shows_all_that_is_to_be_decided_at_once(look):
    assert look(1280)["decided"] <= 800
