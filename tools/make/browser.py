"""Pictures that a Chromium takes of a page."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

FLAGS = ("headless", "no-sandbox", "disable-gpu", "disable-background-networking", "disable-sync", "no-first-run")


def chromium() -> str | None:
    """The program, where there is one."""
    return shutil.which("chromium") or shutil.which("google-chrome")


def picture(browser: str, page: str, target: Path, width: int, height: int) -> None:
    """A PNG of the page at a URL, in a window of this size."""
    with tempfile.TemporaryDirectory() as profile:
        options = [*FLAGS, "hide-scrollbars", f"user-data-dir={profile}", f"window-size={width},{height}"]
        words = [browser, *(f"--{option}" for option in options), f"--screenshot={target}", page]
        subprocess.run(words, capture_output=True, check=True, timeout=120)
