"""The feed of a page: its messages reach the clients, and the page ends with the session."""

import json
import subprocess
import sys
import time
import urllib.request
from contextlib import closing

import pytest

from mpucal.page import server
from mpucal.page.address import Address
from mpucal.page.feed import Feed
from mpucal.session.events import Key, Prompt, PromptKind

PROMPT = Prompt(PromptKind.ROTATE, "Turn the board: on its right edge (+X).", (1.0, 0.0, 0.0))


@pytest.fixture
def feed():
    feed = Feed(Address(), {"title": "a chip", "board": "plain"}, keys=True)
    yield feed
    feed.end()


def followed(url, until):
    """Return the values of the page once `until` is true of them."""
    shown = {}
    with closing(urllib.request.urlopen(f"{url}events", timeout=60.0)) as events:
        for line in events:
            if line.startswith(b"data:"):
                shown |= json.loads(line[5:])
            if until(shown):
                return shown
    return shown


def test_a_late_client_gets_all_values(feed):
    feed.hear(PROMPT)
    feed.say("  a line of talk")
    shown = followed(feed.url, lambda shown: shown.get("notes"))
    assert shown["title"] == "a chip"
    assert shown["prompt"] == {"kind": "rotate", "text": PROMPT.text, "down": [1.0, 0.0, 0.0]}
    assert shown["headline"] == "Turn it"
    assert shown["notes"] == ["a line of talk"]


def test_keys_and_results_go_through(feed, tmp_path):
    (tmp_path / "calibration.json").write_text("{}")
    feed.offer([tmp_path / "calibration.json"])
    assert followed(feed.url, lambda shown: "results" in shown)["results"] == [{"name": "calibration.json", "bytes": 2}]
    assert urllib.request.urlopen(f"{feed.url}results/calibration.json").read() == b"{}"
    urllib.request.urlopen(urllib.request.Request(f"{feed.url}keys/redo", method="POST"))
    until, keys = time.monotonic() + 60.0, []
    while not keys and time.monotonic() < until:
        time.sleep(0.01)
        keys = list(feed.pressed())
    assert keys == [Key.REDO]
    assert feed.pressed() == []


def test_a_connected_client_receives_the_end_before_the_server_closes(feed, monkeypatch):
    monkeypatch.setattr(server, "HEAD_S", 0.5)
    with closing(urllib.request.urlopen(f"{feed.url}events", timeout=60.0)) as events:
        events.readline()
        feed.end()
        assert feed.visited
        assert b'"ended": true' in events.read()
    with pytest.raises(OSError):
        urllib.request.urlopen(feed.url, timeout=60.0)


def test_the_page_ends_with_a_killed_session():
    program = (
        "import sys; from mpucal.page.feed import Feed; from mpucal.page.address import Address\n"
        "print(Feed(Address(), {}).url, flush=True); sys.stdin.read()"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdin=-1, stdout=-1, text=True) as session:
        url = session.stdout.readline()
        urllib.request.urlopen(url).close()
        session.kill()
    until = time.monotonic() + 60.0
    with pytest.raises(OSError):
        while time.monotonic() < until:
            urllib.request.urlopen(url, timeout=60.0).close()
            time.sleep(0.02)
