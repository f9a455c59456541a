"""The page's latency in a real browser, and how many requests of a hostile client it lets in.

python -m tools.lab page_trials --events 200 --requests 10000

The latency is the time from when a session says something to the frame of the browser that shows it, of the same clock.
The requests are drawn at random around one that is let in: another token, host, path or method, or bytes that are no
request at all.
"""

from __future__ import annotations

import argparse
import random
import shutil
import socket
import statistics
import time
from contextlib import suppress
from dataclasses import replace
from urllib.parse import urlsplit

from playwright.sync_api import sync_playwright

from mpucal.page.address import Address
from mpucal.page.feed import Feed
from mpucal.session.events import Meter, Prompt, PromptKind

FLAT, SIDE = (1.0, 0.0, 0.0, 0.0), (0.5**0.5, 0.0, 0.5**0.5, 0.0)
TURNING = Meter(
    0.0, 0.5, False, "", (0.0, 0.0, -1.0), 9.0, 200.0, None, FLAT, 90.0, "90 deg more, roll it to the left", SIDE
)
# each frame notes when the page came to show another number
WATCH = """() => {
  window.painted = [];
  const look = () => {
    const number = document.getElementById('number').textContent;
    if (painted.at(-1)?.[0] !== number) painted.push([number, performance.timeOrigin + performance.now()]);
    requestAnimationFrame(look);
  };
  look();
}"""


def latencies(events: int) -> list[float]:
    """From each event to its frame [ms]."""
    feed = Feed(Address(), {"title": "trial", "board": "gy-521"})
    said: list[tuple[str, float]] = []
    with sync_playwright() as p:
        browser = p.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        tab = browser.new_page()
        tab.goto(feed.url)
        tab.evaluate(WATCH)
        feed.hear(Prompt(PromptKind.ROTATE, "Turn it.", (1.0, 0.0, 0.0)))
        for number in range(events):
            missing = 20.0 + 5.0 * (number % 30)
            time.sleep(0.25)
            said.append((f"{missing:.0f}°", time.time() * 1e3))
            feed.hear(replace(TURNING, t_s=0.25 * number, missing_deg=missing))
        time.sleep(0.5)
        painted = tab.evaluate("painted")
        browser.close()
    feed.close()
    return [
        min(frame - then for text, then in said if text == shown and then <= frame)
        for shown, frame in painted
        if any(text == shown for text, _ in said)
    ]


def let_in(requests: int, seed: int) -> tuple[int, int]:
    """How many of so many hostile requests were answered with anything but a refusal, and how many had no end."""
    draw = random.Random(seed)
    feed = Feed(Address(), {"title": "trial"})
    where = urlsplit(feed.url)
    token, host = where.path.strip("/"), where.netloc
    through = stuck = 0
    for _ in range(requests):
        try:
            with socket.create_connection(("127.0.0.1", where.port or 0), 10.0) as line, suppress(ConnectionError):
                line.sendall(hostile(draw, token, host))
                line.shutdown(socket.SHUT_WR)
                answer = b"".join(iter(lambda: line.recv(65536), b""))
                through += answer[9:10] in (b"1", b"2", b"3")
        except TimeoutError:
            stuck += 1
    feed.close()
    return through, stuck


def hostile(draw: random.Random, token: str, host: str) -> bytes:
    """A request that must not be let in."""
    if draw.random() < 0.2:
        return draw.randbytes(draw.randrange(400)) + draw.choice([b"", b"\r\n\r\n"])
    wrong = list(token)
    wrong[draw.randrange(len(wrong))] = draw.choice("ABCxyz019-_") + draw.choice(["", "x"])
    others = ["".join(wrong), token[:-1], token.swapcase(), "", "..", f"{token}%00", f".//{token}"]
    hosts = ["evil.example", f"localhost:{host.rpartition(':')[2]}", host.partition(":")[0], "", f"{host}.evil.example"]
    names = ["", "events", "page.js", "results/calibration.json", "results/../../etc/passwd", "keys/abort"]
    kind = draw.randrange(3)
    path = f"/{draw.choice([o for o in others if o != token]) if kind == 0 else token}/{draw.choice(names)}"
    if kind == 2:
        path = f"/{token}/{draw.choice(['../', 'x', 'events/', 'results/', '%65vents', 'static/page.js'])}"
    headers = [f"Host: {draw.choice(hosts) if kind == 1 else host}", f"X: {'x' * draw.randrange(200)}"]
    method = draw.choice(["GET", "POST", "HEAD", "PUT", "TRACE"])
    return "\r\n".join([f"{method} {path} HTTP/1.{draw.randrange(3)}", *headers, "", ""]).encode()


def main() -> int:
    """Measure both."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--events", type=int, default=200)
    parser.add_argument("--requests", type=int, default=10000)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    found = sorted(latencies(arguments.events))
    median, most = statistics.median(found), found[int(0.95 * len(found))]
    print(f"{len(found)} of {arguments.events} events shown", end="; ")
    print(f"from event to frame {median:.1f} ms in the median, {most:.1f} at 95 %")
    through, stuck = let_in(arguments.requests, arguments.seed)
    print(f"{arguments.requests} hostile requests: {through} let in, {stuck} without an end")
    return 1 if through or stuck else 0
