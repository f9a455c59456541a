"""Requests that are allowed: those with the right host and token, for the page's own resources."""

from hypothesis import given
from hypothesis import strategies as st

from mpucal.page.address import Address, lan_host, parse_address, qr_code
from mpucal.page.requests import PAGE_FILES, Allowed, RequestFilter
from mpucal.session.events import Key

HOST, TOKEN = "127.0.0.1:8000", "c2VjcmV0LXRva2VuLTEyOA"
RESULTS = {"report.html", "calibration.json"}
LOOKS = {*PAGE_FILES, "events", *(f"results/{name}" for name in RESULTS)}
OTHERS = ["", "..", ".", "%2e%2e", "results", "capture.mcap", "keys", "etc/passwd", "é", "\0", "?", "#"]
PARTS = st.sampled_from(
    [*OTHERS, TOKEN, TOKEN[:-1], TOKEN.swapcase(), f"{TOKEN}x", "events", "page.js", *RESULTS, *Key]
)
TARGETS = st.one_of(
    st.lists(PARTS, max_size=6).map("/".join),
    st.lists(PARTS, max_size=4).map(lambda parts: f"/{TOKEN}/" + "/".join(parts)),
    st.text(max_size=60),
)
HOSTS = st.one_of(
    st.just([HOST]),
    st.lists(st.sampled_from([HOST, "localhost:8000", "evil.example:8000", "127.0.0.1", f" {HOST}", ""]), max_size=3),
)
METHODS = st.sampled_from(["GET", "POST", "HEAD", "PUT", "DELETE", "get", "OPTIONS", ""])
ORIGINS = st.lists(st.sampled_from([f"http://{HOST}", "http://evil.example", "null"]), max_size=2)


@given(METHODS, TARGETS, HOSTS, ORIGINS, st.booleans())
def test_only_requests_with_host_and_token_are_allowed(method, target, hosts, origins, keys):
    request = RequestFilter(HOST, TOKEN, keys).check(method, target, hosts, origins, RESULTS)
    looks = method == "GET" and target in {f"/{TOKEN}/{name}" for name in LOOKS}
    presses = keys and method == "POST" and target in {f"/{TOKEN}/keys/{key}" for key in Key}
    own = all(origin == f"http://{HOST}" for origin in origins)
    assert isinstance(request, Allowed) == (hosts == [HOST] and (looks or (presses and own)))


def test_an_address_is_local_unless_the_network_is_given():
    assert parse_address("127.0.0.1") == Address("127.0.0.1", 0, "127.0.0.1")
    assert parse_address("lan").host == lan_host()
    assert parse_address("[::1]:8000") == Address("::1", 8000, "[::1]")
    assert "█" in qr_code("http://127.0.0.1:8000/token/")
