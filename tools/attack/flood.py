"""Flood a UDP port or a serial line, and measure how long mpucal takes to say so and to hear Ctrl-C.

    .venv/bin/python -m tools.attack flood [CASE ...]

Each case runs a command of its own beside a flood: junk datagrams, heartbeats from ever new ports, or a pseudo terminal
that sends zeros, random bytes or text without end. Once it is left alone, and once it gets one SIGINT after `--after`
seconds. A line says how long it took to end, with which exit code and sentence.
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

ROOT = Path(__file__).parents[2]
INTERRUPT_S = 2.0
GIVE_UP_S = 150.0
LOCKED_S = 8.0
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


def free_port() -> int:
    """One that nobody uses now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def udp(send: Callable[[int], None]) -> Iterator[str]:
    """The port that is flooded, as --mavlink takes it."""
    port = free_port()
    with beside(send, port):
        yield f"--mavlink=udp:127.0.0.1:{port}"


@contextmanager
def locked(send: Callable[[int], None]) -> Iterator[str]:
    """The port of a simulated vehicle, which others flood once it is heard."""
    port = free_port()
    words = [sys.executable, "-m", "tools.lab", "sim_vehicle", f"udp:127.0.0.1:{port}"]
    with subprocess.Popen(words, stdout=subprocess.DEVNULL, cwd=ROOT) as vehicle:
        with beside(later, send, port):
            yield f"--mavlink=udp:127.0.0.1:{port}"
        vehicle.kill()


def later(send: Callable[[int], None], port: int) -> None:
    """The same after a while."""
    time.sleep(LOCKED_S)
    send(port)


@contextmanager
def serial(what: str, option: str = "serial") -> Iterator[str]:
    """The line that is flooded, as --serial or --mavlink takes it."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    with beside(send_bytes, master, what):
        yield f"--{option}={os.ttyname(slave)}"
    os.close(master)
    os.close(slave)


UDP = {"junk": send_junk, "heartbeats": send_heartbeats}
CALIBRATION = "calibration.json"
WORDS: dict[str, tuple[str, ...]] = {
    "session": ("session", "-o", "out"),
    "record": ("record", "--seconds", "15"),
    "stream": ("stream", "--apply", CALIBRATION),
    "doctor": ("doctor",),
    "write": ("write", CALIBRATION, "--yes"),
}
LINES = {
    "udp": {what: lambda send=send: udp(send) for what, send in UDP.items()},
    "serial": {what: lambda what=what: serial(what) for what in SERIAL},
    # a flight controller's
    "vehicle": {what: lambda what=what: serial(what, "mavlink") for what in SERIAL},
    "locked": {"junk": lambda: locked(send_junk)},
}
CASES = {
    f"{command} {line} {what}": (command, line, flood)
    for line, floods in LINES.items()
    for command in WORDS
    for what, flood in floods.items()
    if line == "serial" or (command != "doctor" and (line != "locked" or command in ("session", "record")))
}


def calibration(line: str, folder: Path) -> None:
    """A calibration.json for what is written over this line."""
    source = ("--bus", "sim") if line == "serial" else ("--mavlink", "sim", "--no-write")
    words = [sys.executable, "-m", "mpucal", "session", *source, "--yes", "-o", "made"]
    subprocess.run(words, cwd=folder, check=True, capture_output=True)
    (folder / "made" / CALIBRATION).rename(folder / CALIBRATION)


def ended(words: list[str], folder: Path, after_s: float | None) -> tuple[float, int | None, str]:
    """Seconds to its end (from a signal after so long, where there is one), exit code, last line that it said."""
    out = folder / "said"
    with out.open("wb") as said:
        process = subprocess.Popen(
            [sys.executable, "-m", "mpucal", *words], stdin=subprocess.DEVNULL, stdout=said, stderr=said, cwd=folder
        )
        begun = time.monotonic()
        if after_s is not None:
            time.sleep(after_s)
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
    parser.add_argument("--after", type=float, default=INTERRUPT_S, help="when Ctrl-C comes [s]")
    asked = parser.parse_args()
    # who runs in the background of a shell ignores it, and so would the commands
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for name in asked.cases or CASES:
        command, line, flood = CASES[name]
        for after_s in (None, asked.after):
            with TemporaryDirectory() as folder:
                words = list(WORDS[command])
                if command == "record":
                    words += ["-o", "out.mcap" if line == "serial" else "out.tlog"]
                if CALIBRATION in words:
                    calibration(line, Path(folder))
                if command == "write":
                    words.insert(2, "chip" if line == "serial" else "autopilot")
                with flood() as option:
                    at_s = None if after_s is None else after_s + LOCKED_S * (line == "locked")
                    took_s, code, said = ended([*words, option], Path(folder), at_s)
            how = "alone" if after_s is None else "Ctrl-C"
            print(f"{name:26} {how:7} {took_s:5.1f} s  exit {code}  {said}", flush=True)
