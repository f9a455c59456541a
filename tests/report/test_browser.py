"""The page in a real browser, at the width of a desk and of a phone, and on paper."""

import re

import pytest

LOOK = """width => {
  const page = document, root = page.documentElement;
  page.querySelectorAll('details').forEach(part => part.open = true);
  return {
    wide: root.scrollWidth,
    pictures: [...page.querySelectorAll('svg')].map(svg => svg.getBoundingClientRect().width),
    sticking_out: [...page.querySelectorAll('p, li, figure, h1, h2, th')]
      .filter(e => e.getBoundingClientRect().right > width && !e.closest('.wide')).length,
    cut: [...page.querySelectorAll('#accelerometer td')]
      .filter(e => e.getBoundingClientRect().right > width).length,
    decided: Math.max(...[...page.querySelectorAll('#accelerometer, .first ul')]
      .map(e => e.getBoundingClientRect().bottom)),
    paper: getComputedStyle(page.body).backgroundColor };
}"""


@pytest.fixture(scope="module")
def page(page, result, tmp_path_factory):
    """The report in a browser."""
    path = tmp_path_factory.mktemp("browser") / "report.html"
    path.write_text(result.html, encoding="utf-8")
    page.goto(path.as_uri())
    return page


@pytest.fixture
def look(page):
    """Return the layout of the page in a browser of a width."""

    def at(width):
        page.set_viewport_size({"width": width, "height": 800})
        return page.evaluate(LOOK, width)

    return at


@pytest.mark.parametrize("width", [375, 1200], ids=["phone", "desk"])
def test_the_page_fits_its_window_and_shows_all_pictures(look, page, width):
    seen = look(width)
    assert seen["wide"] <= width
    assert seen["sticking_out"] == seen["cut"] == 0
    assert len(seen["pictures"]) == 7
    assert all(300 < picture <= 640 for picture in seen["pictures"])
    assert seen["paper"] == "rgb(255, 255, 255)"
    assert page.fetched == [page.url]


def test_a_desk_shows_all_that_is_to_be_decided_at_once(look):
    assert look(1280)["decided"] <= 800


def test_prints_on_two_pages(page):
    page.reload()  # as it is before anything in it is opened
    assert len(re.findall(rb"/Type\s*/Page\b(?!s)", page.pdf(prefer_css_page_size=True))) == 2
