"""The page in a Firefox that prefers the dark, driven by its own remote protocol (Marionette) over a socket."""

import json
import os
import shutil
import socket
import subprocess
import time
from contextlib import suppress

import pytest

from mpucal.page.feed import changes, state
from mpucal.terminal.view import View

# Chromium shows the same phases and the same lost connection in test_browser.py
pytestmark = pytest.mark.slow
BROWSER = shutil.which("firefox-esr") or shutil.which("firefox")
# Any free port, and dark colours.
PREFERENCES = {
    "marionette.port": 0,
    "layout.css.prefers-color-scheme.content-override": 0,
    # The others keep it from using the network.
    "app.update.auto": False,
    "browser.shell.checkDefaultBrowser": False,
    "datareporting.policy.dataSubmissionEnabled": False,
    "network.captive-portal-service.enabled": False,
    "network.connectivity-service.enabled": False,
    "network.dns.disableIPv6": True,
    "services.settings.server": "data:,",
    "toolkit.telemetry.enabled": False,
}


class Firefox:
    """Browser with its own profile, and one window of a phone's size.

    Each message either way is its length, a colon and JSON: [0, number, command, parameters] and
    [1, number, error, result].
    """

    def __init__(self, profile):
        lines = (f"user_pref({json.dumps(name)}, {json.dumps(value)});\n" for name, value in PREFERENCES.items())
        (profile / "user.js").write_text("".join(lines), encoding="utf-8")
        self.process = subprocess.Popen(
            [BROWSER, "--headless", "--no-remote", "--marionette", "--profile", profile],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "HOME": str(profile), "MOZ_CRASHREPORTER_DISABLE": "1"},
        )
        self.line = socket.create_connection(("127.0.0.1", self._port(profile)), 120.0)
        self.answers = self.line.makefile("rb")
        self._receive()
        self.number = 0
        self.call("WebDriver:NewSession", capabilities={})
        self.call("WebDriver:SetWindowRect", width=390, height=844)

    def _port(self, profile):
        """Return the port on which it listens, once it does."""
        until = time.monotonic() + 120.0
        while time.monotonic() < until and self.process.poll() is None:
            with suppress(OSError, ValueError):
                return int((profile / "MarionetteActivePort").read_text())
            time.sleep(0.05)
        pytest.fail("Firefox does not listen")

    def _receive(self):
        size = b"".join(iter(lambda: self.answers.read(1), b":"))
        return json.loads(self.answers.read(int(size)))

    def call(self, command, **parameters):
        """Send a command; return its result."""
        self.number += 1
        text = json.dumps([0, self.number, command, parameters]).encode()
        self.line.sendall(b"%d:%s" % (len(text), text))
        _, number, error, result = self._receive()
        assert (number, error) == (self.number, None)
        return result

    def run(self, script):
        """Run a script in the page; return its result."""
        return self.call("WebDriver:ExecuteScript", script=script, args=[])["value"]

    def wait(self, script, seconds=120.0):
        """Wait until a script returns something true."""
        until = time.monotonic() + seconds
        while not (found := self.run(script)):
            assert time.monotonic() < until, f"{script}: {self.text()}"
            time.sleep(0.05)
        return found

    def text(self):
        """Return the visible text of the page."""
        return self.run("return document.body.innerText")

    def close(self):
        """End it."""
        with suppress(OSError, ValueError):
            self.call("Marionette:Quit", flags=["eForceQuit"])
        self.line.close()
        try:
            self.process.wait(20.0)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


@pytest.fixture(scope="module")
def firefox(tmp_path_factory):
    """A browser."""
    if BROWSER is None:
        pytest.skip("there is no Firefox here")
    browser = Firefox(tmp_path_factory.mktemp("firefox"))
    yield browser
    browser.close()


def luminance(colour):
    """0..1 of "rgb(r, g, b)"."""
    return sum(map(int, colour.strip("rgb()").split(","))) / 765


def test_a_session_is_followed_to_its_end_in_the_dark(firefox, server, phases):
    view = View()
    server.latest.update({"title": "a chip", "board": "gy-521"})
    firefox.call("WebDriver:Navigate", url=server.url)
    for outputs, headline, number, _ in phases.values():
        for output in outputs:
            view = view.after(output)
        server.latest.update(changes(state(view), {}))
        for name, text in (("headline", headline), ("number", number)):
            firefox.wait(f"return document.getElementById({name!r}).textContent === {json.dumps(text)}")
    server.latest.update({"verdict": "good", "ended": True})
    firefox.wait("return document.body.innerText.includes('The calibration is good.')")
    assert luminance(firefox.run("return getComputedStyle(document.body).backgroundColor")) < 0.1
    assert luminance(firefox.run("return getComputedStyle(document.body).color")) > 0.9
