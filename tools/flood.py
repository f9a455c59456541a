"""Flood a UDP port or a serial line, and measure how long mpucal takes to say so and to hear Ctrl-C.

    .venv/bin/python tools/flood.py [CASE ...]

Each case runs a command of its own beside a flood of `--seconds`: junk datagrams, heartbeats from ever new ports, or a
pseudo terminal that sends zeros, random bytes or text without end. Once it is left alone, and once it gets one SIGINT
after two seconds. A line says how long it took to end, with which exit code and sentence.
"""

from __future__ import annotations

import argparse
import os
import pty
import signal
import socket
import subprocess
import sys
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import cycle
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

INTERRUPT_S = 2.0
GIVE_UP_S = 75.0
DATAGRAM_BYTES = 64
SOCKETS = 64
SERIAL = {"zeros": lambda: bytes(4096), "random": lambda: os.urandom(4096), "text": lambda: b"on a board\r\n" * 300}


def send_junk(port: int) -> None:
    """Datagrams that hold no packet."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        data = bytes(range(DATAGRAM_BYTES))
        while True:
            sender.sendto(data, ("127.0.0.1", port))


def send_heartbeats(port: int) -> None:
    """Heartbeats of many vehicles from many ports."""
    from pymavlink.dialects.v20 import ardupilotmega as m  # noqa: PLC0415

    senders = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(SOCKETS)]
    packets = [m.MAVLink(None, system, 1).heartbeat_encode(2, 3, 0, 0, 3) for system in range(1, 251)]
    data = [bytes(packet.pack(m.MAVLink(None, system, 1))) for system, packet in enumerate(packets, 1)]
    for number, packet in enumerate(cycle(data)):
        senders[number % SOCKETS].sendto(packet, ("127.0.0.1", port))


def send_bytes(handle: int, what: str) -> None:
    """The same without end on a line."""
    make = SERIAL[what]
    while True:
        os.write(handle, make())


@contextmanager
def beside(send: Callable[..., None], *arguments: object) -> Iterator[None]:
    """A process that sends meanwhile."""
    process = get_context("fork").Process(target=send, args=arguments, daemon=True)
    process.start()
    try:
        yield
    finally:
        process.kill()
        process.join()


@contextmanager
def udp(send: Callable[[int], None]) -> Iterator[str]:
    """The port that is flooded, as --mavlink takes it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with beside(send, port):
        yield f"--mavlink=udp:127.0.0.1:{port}"


@contextmanager
def serial(what: str) -> Iterator[str]:
    """The line that is flooded, as --serial takes it."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    with beside(send_bytes, master, what):
        yield f"--serial={os.ttyname(slave)}"
    os.close(master)
    os.close(slave)


CASES = {
    "session udp junk": ("session", lambda: udp(send_junk)),
    "session udp heartbeats": ("session", lambda: udp(send_heartbeats)),
    **{
        f"{command} serial {what}": (command, lambda what=what: serial(what))
        for what in SERIAL
        for command in ("session", "doctor")
    },
}


def ended(words: list[str], folder: Path, interrupt: bool) -> tuple[float, int | None, str]:
    """Seconds to its end (from the signal, where there is one), exit code, last line that it said."""
    out = folder / "said"
    with out.open("wb") as said:
        process = subprocess.Popen(
            [sys.executable, "-m", "mpucal", *words], stdin=subprocess.DEVNULL, stdout=said, stderr=said, cwd=folder
        )
        begun = time.monotonic()
        if interrupt:
            time.sleep(INTERRUPT_S)
            begun = time.monotonic()
            process.send_signal(signal.SIGINT)
        try:
            code: int | None = process.wait(GIVE_UP_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            code = None
        took_s = time.monotonic() - begun
    lines = out.read_text("utf-8", "replace").strip().splitlines()
    return took_s, code, lines[-1][:160] if lines else ""


def main() -> None:
    """See the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", metavar="CASE", help=f"some of: {', '.join(CASES)}; default: all")
    for name in (asked := parser.parse_args().cases or list(CASES)):
        command, flood = CASES[name]
        for interrupt in (False, True):
            with TemporaryDirectory() as folder, flood() as option:
                words = [command, option, *(["-o", "out"] if command == "session" else [])]
                took_s, code, said = ended(words, Path(folder), interrupt)
            print(f"{name:24} {'Ctrl-C' if interrupt else 'alone':7} {took_s:5.1f} s  exit {code}  {said}", flush=True)
    sys.exit(0 if asked else 2)


if __name__ == "__main__":
    main()
