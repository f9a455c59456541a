"""The documentation site as a browser shows it from its folder, where nothing else can be reached."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from mpucal.cli import commands

PROJECT = Path(__file__).parents[3]
DESKTOP, PHONE = {"width": 1280, "height": 900}, {"width": 390, "height": 844}


def built(folder, notebook):
    """Build the site as `make docs` does, where a warning is an error; without the notebook, whose cells take long."""
    words = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir", folder]
    how = {**os.environ, "NO_MKDOCS_2_WARNING": "1", "RUN_NOTEBOOK": notebook}
    done = subprocess.run(words, cwd=PROJECT, env=how, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="session")
def site(once):
    return once("site", lambda folder: built(folder, "false"))


def from_elsewhere(page):
    return [url for url in page.fetched if not url.startswith(("file:", "data:"))]


def fits(page, file):
    page.goto(file.as_uri())
    for size in (DESKTOP, PHONE):
        page.set_viewport_size(size)
        assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]
        assert page.evaluate("[...document.images].every((image) => image.complete && image.naturalWidth > 0)")
    assert from_elsewhere(page) == []


@pytest.mark.parametrize("name", ["index", "reference/commands", "reference/python"])
def test_a_page_fits_and_fetches_nothing_from_elsewhere(site, page, name):
    fits(page, site / f"{name}.html")


@pytest.mark.slow
def test_the_notebook_runs_and_its_page_fits(page, tmp_path):
    built(tmp_path, "true")
    text = (tmp_path / "notebook.html").read_text(encoding="utf-8")
    assert text.count("<img") >= 3 and "<table>" in text
    fits(page, tmp_path / "notebook.html")


def test_the_search_finds(site, page):
    for size, way_in in ((DESKTOP, ".md-search__form"), (PHONE, ".md-header__button[for=__search]")):
        page.set_viewport_size(size)
        page.goto((site / "reference" / "python.html").as_uri())
        page.click(way_in)
        page.locator(".md-search__input").press_sequentially("misalignment")
        page.locator(".md-search-result__item a").first.wait_for()
    assert from_elsewhere(page) == []


def test_no_link_begins_at_the_root_of_a_server(site):
    pages = list(site.rglob("*.html"))
    assert len(pages) > 20
    assert [page.name for page in pages if 'href="/' in page.read_text(encoding="utf-8")] == []


def test_every_command_has_its_section(site):
    text = (site / "reference" / "commands.html").read_text(encoding="utf-8")
    assert [name for name in commands.list_commands(None) if f'id="mpucal-{name}"' not in text] == []
    assert "Sentinel" not in text
