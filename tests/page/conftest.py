"""Fixtures: a page's server in this process, and a tab of a browser."""

import socket
import sys
import threading
from contextlib import closing, suppress

import pytest

from mpucal.page.server import Server
from mpucal.session.events import Countdown, Held, Meter, Prompt, PromptKind, Use

FLAT, ON_ITS_SIDE = (1.0, 0.0, 0.0, 0.0), (0.5**0.5, 0.0, -(0.5**0.5), 0.0)
TURN = Prompt(PromptKind.ROTATE, "Turn the board: on its right edge (+X), then hold it still.", (-1.0, 0.0, 0.0))


def meter(t_s, missing_deg, turn, wanted=ON_ITS_SIDE):
    return Meter(t_s, 0.3, False, "", (0.0, 0.0, -1.0), 5.0, 200.0, None, FLAT, missing_deg, turn, wanted)


PHASES = {
    "lay flat": ([Prompt(PromptKind.LAY_FLAT, "Lay it flat.")], "Lay flat", "", "wait"),
    "turn": ([TURN, meter(1.0, 91.0, "90 deg more, roll it to the left")], "Roll it to the left", "90°", "turn"),
    "near": ([meter(2.0, 9.0, "10 deg more, roll it to the left")], "Hold still", "9°", "hold"),
    "hold": ([meter(3.0, 4.0, ""), Countdown(3.0, 1.2, 2.0, False)], "Hold still", "2", "hold"),
    "taken": ([Held(4.2, Use.TAKEN, (1.0, 0.0, 0.0), "taken"), meter(4.25, 4.0, "")], "Taken", "", "yes"),
    "seen": ([Held(6.0, Use.SEEN, (1.0, 0.0, 0.0), "seen already"), meter(6.1, 4.0, "")], "Seen already", "", "again"),
}

TOKEN = "c2VjcmV0LXRva2VuLTEyOA"


class Watched(Server):
    """Server that keeps its errors, with the functions of a client."""

    def __init__(self, port=0, **more):
        self.errors, self.lines = [], []
        super().__init__(("127.0.0.1", port), "127.0.0.1", TOKEN, **more)
        self.url = f"http://{self.filter.host}/{TOKEN}/"
        threading.Thread(target=self.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True).start()

    def process_request(self, request, client_address):
        self.lines.append(request)
        super().process_request(request, client_address)

    def handle_error(self, request, client_address):
        if not isinstance(sys.exception(), OSError):
            self.errors.append(sys.exception())

    def request(self, name, method="GET", *headers):
        """Return a request that is allowed."""
        return "\r\n".join(
            [f"{method} /{TOKEN}/{name} HTTP/1.1", f"Host: {self.filter.host}", *headers, "", ""]
        ).encode()

    def connect(self):
        return socket.create_connection(("127.0.0.1", self.server_port), 60.0)

    def answer(self, request):
        """Send these bytes; return the answer, up to the end of the connection."""
        answer = b""
        with closing(self.connect()) as line, suppress(ConnectionError):
            line.sendall(request)
            line.shutdown(socket.SHUT_WR)
            while piece := line.recv(65536):
                answer += piece
        return answer

    def follow(self):
        """Return a connection that follows the session, and its first event or refusal."""
        line, head = self.connect(), b""
        line.sendall(self.request("events"))
        while b"data:" not in head and b" 503 " not in head:
            head += line.recv(4096)
        return line, head

    def stop(self):
        for line in self.lines:
            with suppress(OSError):
                line.shutdown(socket.SHUT_RDWR)
        self.shutdown()
        self.server_close()


@pytest.fixture
def serve():
    """Return a function that starts a server."""
    servers = []

    def call(*words, **more):
        servers.append(Watched(*words, **more))
        return servers[-1]

    yield call
    for server in servers:
        server.stop()
    assert [server.errors for server in servers] == [[]] * len(servers)


@pytest.fixture(scope="session")
def phases():
    """Return the outputs of each phase of a session, and the headline, number and look of the page then."""
    return PHASES


@pytest.fixture
def server(serve):
    return serve()


@pytest.fixture
def tab(chromium):
    """Return a tab; at its end no script may have failed, and the policy must have stopped nothing."""
    context = chromium.new_context(viewport={"width": 390, "height": 844})
    tab = context.new_page()
    wrong = []
    tab.on("pageerror", lambda error: wrong.append(str(error)))
    tab.on("console", lambda line: wrong.append(line.text) if "Content Security Policy" in line.text else None)
    tab.set_default_timeout(60000)
    yield tab
    context.close()
    assert wrong == []
