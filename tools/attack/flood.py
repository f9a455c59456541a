"""Flood a UDP port or a serial line, and measure how long mpucal takes to report it and to react to Ctrl-C.

    python -m tools.attack flood [CASE ...]

Each case runs a command during a flood: junk datagrams, heartbeats from ever new ports, or a pseudo terminal that sends
zeros, random bytes or text without end. It runs once undisturbed, and once with a SIGINT after `--after` seconds. A
line gives the time until it ended, its exit code and its last sentence.
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
from functools import partial
from itertools import cycle
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

from mpucal.mavlink.dialect import dialect
from tools.processes import Ended, ended

ROOT = Path(__file__).parents[2]
INTERRUPT_S, GIVE_UP_S, LOCKED_S = 2.0, 150.0, 8.0
DATAGRAM_BYTES, SOCKETS = 64, 64
SERIAL = {"zeros": lambda: bytes(4096), "random": lambda: os.urandom(4096), "text": lambda: b"on a board\r\n" * 300}
CALIBRATION = "calibration.json"
WORDS: dict[str, tuple[str, ...]] = {
    "session": ("session", "-o", "out"),
    "record": ("record", "--seconds", "15"),
    "stream": ("stream", "--apply", CALIBRATION),
    "doctor": ("doctor",),
    "write": ("write", CALIBRATION, "--yes"),
}


def send_junk(port: int, after_s: float = 0.0) -> None:
    """Send datagrams that contain no packet."""
    time.sleep(after_s)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        while True:
            sender.sendto(bytes(range(DATAGRAM_BYTES)), ("127.0.0.1", port))


def send_heartbeats(port: int) -> None:
    """Send heartbeats of many vehicles from many ports."""
    m = dialect()
    senders = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(SOCKETS)]
    beat = m.MAVLink_heartbeat_message(2, 3, 0, 0, 3, 3)
    data = [bytes(beat.pack(m.MAVLink(None, system, 1))) for system in range(1, 251)]
    for number, packet in enumerate(cycle(data)):
        senders[number % SOCKETS].sendto(packet, ("127.0.0.1", port))


def send_bytes(handle: int, what: str) -> None:
    """Write the same data to a serial line without end."""
    while True:
        os.write(handle, SERIAL[what]())


@contextmanager
def beside(send: Callable[..., None], *arguments: object) -> Iterator[None]:
    """Run `send` in a process while the block runs."""
    process = get_context("fork").Process(target=send, args=arguments, daemon=True)
    process.start()
    try:
        yield
    finally:
        process.kill()
        process.join()


@contextmanager
def udp(send: Callable[..., None], vehicle: bool = False) -> Iterator[str]:
    """Flood a free UDP port while the block runs, and yield its --mavlink option; vehicle : simulate one there."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = int(probe.getsockname()[1])
    if not vehicle:
        with beside(send, port):
            yield f"--mavlink=udp:127.0.0.1:{port}"
        return
    words = [sys.executable, "-m", "tools.lab", "sim_vehicle", f"udp:127.0.0.1:{port}"]
    with subprocess.Popen(words, stdout=subprocess.DEVNULL, cwd=ROOT) as running:
        with beside(send, port, LOCKED_S):
            yield f"--mavlink=udp:127.0.0.1:{port}"
        running.kill()


@contextmanager
def serial(what: str, option: str) -> Iterator[str]:
    """Flood a serial line while the block runs, and yield its --serial or --mavlink option."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    with beside(send_bytes, master, what):
        yield f"--{option}={os.ttyname(slave)}"
    os.close(master)
    os.close(slave)


LINES = {
    "udp": {"junk": partial(udp, send_junk), "heartbeats": partial(udp, send_heartbeats)},
    "serial": {what: partial(serial, what, "serial") for what in SERIAL},
    # the serial line of a flight controller
    "vehicle": {what: partial(serial, what, "mavlink") for what in SERIAL},
    "locked": {"junk": partial(udp, send_junk, vehicle=True)},
}
CASES = {
    f"{command} {line} {what}": (command, line, flood)
    for line, floods in LINES.items()
    for command in WORDS
    for what, flood in floods.items()
    if line == "serial" or (command != "doctor" and (line != "locked" or command in ("session", "record")))
}


def calibration(line: str, folder: Path) -> None:
    """Make the calibration.json that `mpucal write` writes over this line."""
    source = ("--bus", "sim") if line == "serial" else ("--mavlink", "sim", "--no-write")
    words = [sys.executable, "-m", "mpucal", "session", *source, "--yes", "-o", "made"]
    subprocess.run(words, cwd=folder, check=True, capture_output=True)
    (folder / "made" / CALIBRATION).rename(folder / CALIBRATION)


def flooded(command: str, line: str, option: str, folder: Path, after_s: float | None) -> tuple[float, Ended]:
    """Run a command, interrupt it after `after_s` if given, and return the seconds from then to its end."""
    words = list(WORDS[command])
    if command == "record":
        words += ["-o", "out.mcap"]
    if command == "write":
        words.insert(2, "chip" if line == "serial" else "autopilot")
    with (folder / "said").open("wb") as said:
        words = [sys.executable, "-m", "mpucal", *words, option]
        process = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=said, stderr=said, cwd=folder)
    begun = time.monotonic()
    if after_s is not None:
        time.sleep(after_s)
        begun = time.monotonic()
        os.kill(process.pid, signal.SIGINT)
    done = ended(process.pid, folder / "said", GIVE_UP_S)
    return time.monotonic() - begun, done


def main() -> None:
    """Run the cases, and print a line for each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", metavar="CASE", help=f"some of: {', '.join(CASES)}; default: all")
    parser.add_argument("--after", type=float, default=INTERRUPT_S, help="when Ctrl-C comes [s]")
    asked = parser.parse_args()
    # a program in the background of a shell ignores SIGINT, and its children inherit that
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for name in asked.cases or CASES:
        command, line, flood = CASES[name]
        for how, after_s in (("alone", None), ("Ctrl-C", asked.after + LOCKED_S * (line == "locked"))):
            with TemporaryDirectory() as place:
                if CALIBRATION in WORDS[command]:
                    calibration(line, Path(place))
                with flood() as option:
                    took_s, done = flooded(command, line, option, Path(place), after_s)
            print(f"{name:26} {how:7} {took_s:5.1f} s  exit {done.code}  {done.last[:160]}", flush=True)
