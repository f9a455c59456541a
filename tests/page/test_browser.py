"""The page in a real browser, beside a session on the simulated chip."""

import json
import subprocess
import sys

import pytest

from mpucal.page.feed import changes, state
from mpucal.reasons import Reason
from mpucal.terminal.view import View

# Records the page's texts at each change.
WATCH = """() => {
  window.shown = [];
  const look = () => shown.push(Object.fromEntries(
    ['headline', 'prompt', 'number', 'spoken'].map((id) => [id, document.getElementById(id).textContent])));
  new MutationObserver(look).observe(document.body, {subtree: true, childList: true, characterData: true});
  look();
}"""
DRAWN = """([look, number]) =>
    document.body.dataset.look === look && document.querySelector("#number").textContent === number"""

MARKED = "(transform) => document.querySelector('#way').getAttribute('transform') === transform"


def test_each_phase_has_its_words_its_angle_and_its_form(tab, server, phases):
    view, old = View(), {}

    def show(**more):
        nonlocal old
        new = {**state(view), "title": "a chip", "board": "gy-521", **more}
        server.latest.update(changes(new, old))
        old = new

    tab.goto(server.url)
    for outputs, headline, number, look in phases.values():
        for output in outputs:
            view = view.after(output)
        show()
        tab.wait_for_function(DRAWN, arg=[look, number])
        assert tab.inner_text("#headline") == headline
        if look == "turn":
            assert tab.get_attribute("#way", "transform") == "rotate(-90)"
    # Half a turn ends alike both ways round: the mark points where the words say.
    for words, degrees in (("tip it away from you", 0), ("tip it toward you", 180)):
        turned_over = {"t_s": 20.0, "missing_deg": 179.0, "wanted": (0.0, 1.0, 0.0, 0.0)}
        view = view.after(view.meter._replace(turn=f"180 deg more, {words}", **turned_over))
        show()
        tab.wait_for_function(MARKED, arg=f"rotate({degrees})")
    against = Reason("few_orientations", "too few orientations", "turn it more", refuse=True)
    show(verdict="refused", reasons=[against.document()])
    tab.wait_for_selector("#reasons li")
    assert tab.inner_text("#reasons") == "Too few orientations. Turn it more."
    assert tab.inner_text("#headline") == "The calibration is refused."
    assert tab.get_attribute("body", "data-look") == "no"


def test_a_lost_connection_is_shown_and_reopened(tab, serve):
    server = serve()
    server.latest.update({"title": "a chip", "headline": "Before"})
    tab.goto(server.url)
    tab.wait_for_selector("text=Before")
    port = server.server_port
    server.stop()
    tab.wait_for_selector("#lost:visible")
    assert "Connection lost" in tab.inner_text("#lost")
    again = serve(port)
    again.latest.update({"title": "a chip", "headline": "After"})
    tab.wait_for_selector("text=After")
    assert tab.is_hidden("#lost")


# A session that begins when two browsers follow it.
SESSION_FOR_TWO = """
import time
from mpucal.__main__ import main
from mpucal.page import console
invite = console._invite
def invite_two(feed, *how):
    invite(feed, *how)
    while feed._server.clients < 2:
        time.sleep(0.02)
console._invite = invite_two
main()
"""


@pytest.fixture
def session(tmp_path):
    """A session with a page, as fast as it can be once two browsers follow it: its process, the address, its folder."""
    words = ["session", "--bus", "sim:pace=fast", "--seed", "3", "--rate", "50", "--target", "quick"]
    words += ["--page", "--yes", "--json-events", "-o", "board"]
    with subprocess.Popen(
        [sys.executable, "-c", SESSION_FOR_TWO, *words], cwd=tmp_path, stdout=-1, stderr=-1, text=True
    ) as process:
        address = json.loads(process.stderr.readline())["address"]
        yield process, address, tmp_path / "board"
        process.kill()


def test_two_browsers_follow_a_session_to_its_results(chromium, tab, session):
    process, address, folder = session
    tab.goto(address)
    tab.evaluate(WATCH)
    other = chromium.new_page(color_scheme="dark")
    other.goto(address)
    events = [json.loads(line) for line in process.stderr]
    for page in (tab, other):
        page.wait_for_selector("text=The calibration is good.")
    assert process.wait() == 0
    shown = tab.evaluate("shown")
    prompts = {event["text"] for event in events if event["event"] == "prompt"}
    turns = {event["turn"].rpartition(", ")[2].capitalize() for event in events if event["event"] == "meter"}
    found = tab.inner_text("#prompt")
    assert found.startswith("Estimated error at rest: ")
    elsewhere = "Not the wanted orientation, but a new and useful one."
    assert {one["prompt"] for one in shown} - {"", found, elsewhere} <= prompts
    # The values of x, y and z fit into the width of a phone.
    assert tab.locator("#values td:not(:empty)").count() == 12
    assert tab.evaluate("document.documentElement.scrollWidth") <= 390
    assert {one["headline"] for one in shown} & turns
    # The results can be saved after the session.
    with other.expect_download() as download:
        other.click("text=calibration.json")
    assert download.value.path().read_bytes() == (folder / "calibration.json").read_bytes()
    assert other.is_hidden("#lost")
    other.close()
