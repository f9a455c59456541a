"""The server over real connections: its answers, and slow or hostile clients."""

import json
import time
from contextlib import ExitStack, closing, suppress

from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.page import server as module
from mpucal.page.requests import PAGE_FILES

METHODS = ["GET", "POST", "HEAD", "TRACE", "G\0T", ""]
JUNK = st.one_of(st.binary(max_size=80), st.text(max_size=40).map(lambda text: text.encode()))


def lines(*parts):
    return b"\r\n".join(parts) + b"\r\n\r\n"


def test_the_page_loads_nothing_from_elsewhere(server):
    for name in PAGE_FILES:
        head, _, body = server.answer(server.request(name)).partition(b"\r\n\r\n")
        assert head.startswith(b"HTTP/1.1 200 OK\r\n")
        assert b"Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'" in head
        assert b"Referrer-Policy: no-referrer" in head
        assert b"://" not in body.replace(b'"http://www.w3.org/2000/svg"', b"")


@settings(max_examples=60)
@given(st.data())
def test_other_requests_are_refused_without_errors(server, data):
    token, host = server.filter.token.encode(), server.filter.host.encode()
    method = data.draw(st.sampled_from(METHODS)).encode("latin-1")
    near = st.sampled_from(
        [b"/", b"/" + token, b"/" + token[:-1] + b"/", b"/x" + token + b"/", b"/" + token + b"/../x"]
    )
    target = data.draw(st.one_of(near, JUNK))
    named = data.draw(
        st.sampled_from([b"Host: " + host, b"Host: evil.example", b"Host: " + host + b"\r\nHost: x", b"X"])
    )
    request = data.draw(st.one_of(st.just(lines(method + b" " + target + b" HTTP/1.1", named)), JUNK.map(lines), JUNK))
    answer = server.answer(request)
    assert b" 200 " not in answer[:20]
    assert b"page.js" not in answer
    assert server.errors == []


def test_results_are_fetched_by_their_names_alone(server, tmp_path):
    (tmp_path / "report.html").write_text("<p>the report</p>")
    (tmp_path / "secret.txt").write_text("secret")
    server.results = {"report.html": tmp_path / "report.html"}
    assert server.answer(server.request("results/report.html")).endswith(b"<p>the report</p>")
    for name in ("secret.txt", "../secret.txt", "report.html/../secret.txt", "%72eport.html", ""):
        assert b" 404 " in server.answer(server.request(f"results/{name}"))[:20]


def test_keys_are_accepted_only_if_allowed(server, serve):
    pressed = []
    other = serve(keys=True, pressed=pressed.append)
    assert b" 405 " in server.answer(server.request("keys/redo", "POST"))[:20]
    assert b" 403 " in other.answer(other.request("keys/redo", "POST", "Origin: http://evil.example"))[:20]
    assert b" 405 " in other.answer(other.request("keys/redo", "GET"))[:20] or pressed == []
    assert b" 204 " in other.answer(other.request("keys/redo", "POST", f"Origin: http://{other.filter.host}"))[:20]
    assert pressed == ["redo"]


def test_a_request_has_limits_of_time_and_size(server, monkeypatch):
    monkeypatch.setattr(module, "HEAD_S", 0.1)
    for begun in (b"GET /", b"GET / HTTP/1.1\r\nX: " + b"x" * 70000):
        with closing(server.connect()) as line, suppress(ConnectionError):
            line.sendall(begun)
            assert line.recv(100) == b""


def test_there_are_four_clients_at_most_and_one_that_leaves_makes_room(server, monkeypatch):
    monkeypatch.setattr(module, "BEAT_S", 0.02)
    with ExitStack() as stack:

        def status():
            line, head = server.follow()
            stack.enter_context(closing(line))
            return head[9:12], line

        four = [status() for _ in range(module.CLIENTS)]
        assert {code for code, _ in four} == {b"200"}
        assert status()[0] == b"503"
        four[0][1].close()
        until = time.monotonic() + 60.0
        while server.clients == module.CLIENTS and time.monotonic() < until:
            time.sleep(0.01)
        assert status()[0] == b"200"


def test_a_stalled_client_gets_the_latest_and_delays_no_other(server, monkeypatch):
    monkeypatch.setattr(module, "WAITING_BYTES", 4096)
    stalled, _ = server.follow()
    reading, _ = server.follow()
    rest = b""
    for number in range(400):
        server.latest.update({"number": number, "ballast": "x" * 20000})
    with closing(reading):
        while b'"number": 399' not in rest:
            rest = (rest + reading.recv(65536))[-70000:]
    with closing(stalled):
        data, got = b"", 0
        while b'"number": 399' not in data[-70000:]:
            piece = stalled.recv(65536)
            got += len(piece)
            data += piece
    events = [json.loads(line[6:]) for line in data.split(b"\n") if line.startswith(b"data: {")]
    numbers = [event["number"] for event in events if "number" in event]
    assert numbers == sorted(numbers)
    assert numbers[-1] == 399
