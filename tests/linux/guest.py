"""Runs in the kernel that conftest.py boots: mpucal's commands; what they say in lines of JSON, their files in OUT."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Timer
from typing import Any

from click.testing import CliRunner

from mpucal import cli
from mpucal.errors import MpucalError

IIO, I2C = Path("/sys/bus/iio/devices"), Path("/sys/bus/i2c")
OUT = Path("/out")
HERE = Path(__file__).parent
MPUCAL = Path(sys.executable).parent / "mpucal"
ADDRESSES = ("0068", "0069")
DETACH = Path("/sys/devices/platform/vhci_hcd.0/detach")
RATE = ("--rate", "50")


def tell(step: str, **facts: Any) -> None:
    """A line for the test, with the time since the kernel started."""
    up = float(Path("/proc/uptime").read_text().split()[0])
    print("SAID " + json.dumps({"step": step, "up": up, **facts}), flush=True)


def run(step: str, *words: str, **facts: Any) -> str:
    """One command of mpucal, in this process: each start of another takes seconds here."""
    ran = CliRunner().invoke(cli.commands, list(words), standalone_mode=False)
    error = ran.exception
    sentence = str(error) if isinstance(error, MpucalError) else repr(error) if error else ""
    tell(step, code=ran.return_value or 0 if error is None else sentence, out=ran.stdout, said=ran.stderr, **facts)
    return ran.stdout


def record(step: str, *words: str, seconds: float = 4) -> None:
    """`mpucal record`, to a file in OUT that is named after the step."""
    run(step, "record", *words, *RATE, "--seconds", str(seconds), "-o", str(OUT / f"{step}.mcap"))


def wait_for(there: Callable[[], Any], seconds: float = 60.0) -> Any:
    """What it gives once it gives something; of the time that the guest sees."""
    end = time.monotonic() + seconds
    while not (found := there()) and time.monotonic() < end:
        time.sleep(0.1)
    if not found:
        raise TimeoutError(f"waited {seconds:g} s")
    return found


def later(seconds: float, do: Callable[[], Any]) -> None:
    """Do it while a command runs."""
    Timer(seconds, do).start()


class Board:
    """Two simulated chips in a hand, behind a real adapter; see adapter.py.

    Attributes
    ----------
    bus : the adapter's number. rate_hz : what the chips make of 50 Hz.
    """

    def __init__(self, text: str) -> None:
        program = [sys.executable, str(HERE / "adapter.py"), text]
        self._process = subprocess.Popen(program, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        truth = json.loads(self._process.stdout.readline())
        tell("truth", **truth)
        self.rate_hz = 50 * (1 + truth["rate_error_ppm"] * 1e-6)
        names = wait_for(lambda: [p for p in I2C.glob("devices/i2c-*/name") if "i2c-tiny-usb" in p.read_text()])
        self.bus = names[0].parent.name.removeprefix("i2c-")

    def hears(self, kind: str, down: Any = None) -> None:
        """A prompt."""
        self._told(prompt={"kind": kind, "down": down})

    def register_0(self, address: int, value: int) -> None:
        """What a chip holds there."""
        self._told(address=address, register_0=value)
        # nothing answers; it is done long before a command gets so far
        time.sleep(0.1)

    def session(self, step: str, *words: str) -> None:
        """A whole session, its prompts obeyed; its folder comes to OUT."""
        folder = f"/run/{step.replace(' ', '-')}"
        command = [str(MPUCAL), "session", *words, *RATE, "--target", "quick", "--yes", "--json-events", "-o", folder]
        said = []
        with subprocess.Popen(command, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
            for line in process.stderr:
                event = json.loads(line) if line.startswith("{") else {"event": "line", "what": line}
                if event["event"] == "prompt":
                    self.hears(event["kind"], event.get("down"))
                if event["event"] in ("line", "error", "note", "prompt"):
                    said.append(event)
        subprocess.run(["cp", "-r", folder, OUT], check=False)
        tell(step, code=process.wait(), said=said)

    def unplug(self) -> None:
        """Take the adapter out of its socket."""
        DETACH.write_text("0")

    def close(self) -> None:
        """End the chips."""
        self._process.kill()
        self._process.wait()

    def _told(self, **what: Any) -> None:
        self._process.stdin.write(json.dumps(what) + "\n")
        self._process.stdin.flush()


def over_bus(board: Board) -> None:
    """The real /dev/i2c-N."""
    bus = ("--bus", board.bus)
    board.hears("lay_flat")
    run("doctor", "doctor", *bus, "--seconds", "2", *RATE, "--json")
    record("recorded", *bus)
    board.session("session", *bus)
    board.hears("lay_flat")
    later(3, board.unplug)
    record("unplugged", *bus, seconds=20)


def over_iio(board: Board) -> None:
    """The kernel's own driver, with an interrupt."""
    device, *_ = bound(board)
    iio, held, client = ("--iio", device), IIO / device, f"{board.bus}-{ADDRESSES[0]}"
    tell("bound", device=device)
    record("held", "--bus", board.bus, "--address", "0x68")
    run("doctor", "doctor", *iio, "--seconds", "2", *RATE, "--json")
    record("polled", *iio, "--trigger", "none")
    record("buffered", *iio)
    tell("put back", enable=(held / "buffer/enable").read_text(), rate=(held / "sampling_frequency").read_text())
    other = os.open(f"/dev/{device}", os.O_RDONLY | os.O_NONBLOCK)
    record("another reader", *iio)
    os.close(other)
    board.register_0(0x68, 0)
    record("empty", *iio)
    board.register_0(0x68, 1)
    later(2, sleep_through)
    record("overrun", *iio, seconds=8)
    board.session("session", *iio)
    written(board, iio)
    later(2, lambda: (I2C / "drivers/inv-mpu6050-i2c/unbind").write_text(client))
    record("unbound", *iio, seconds=20)


def over_two(board: Board) -> None:
    """Accelerometer and gyroscope of two devices."""
    accel, gyro = bound(board)
    board.session("session", "--iio", f"accel={accel},gyro={gyro}")


def bound(board: Board) -> list[str]:
    """The devices that the kernel's driver makes of the chips, as on a board with INT wires."""
    board.hears("lay_flat")
    addresses = ",".join(f"0x{address}" for address in ADDRESSES)
    wires = [f"adapter={board.bus}", f"addresses={addresses}", f"period_us={round(1e6 / board.rate_hz)}"]
    subprocess.run(["/bin/busybox", "insmod", "/modules/interrupt.ko", *wires], check=True)
    clients = [I2C / "devices" / f"{board.bus}-{address}" for address in ADDRESSES]
    return [wait_for(lambda c=c: [path.name for path in c.glob("iio:device*")])[0] for c in clients]


def sleep_through() -> None:
    """This process stands still for four seconds; the kernel goes on, and its buffer holds two."""
    subprocess.Popen(["/bin/sh", "-c", f"sleep 4; kill -CONT {os.getpid()}"])
    os.kill(os.getpid(), 19)


def written(board: Board, iio: tuple[str, str]) -> None:
    """What a session found, into calibbias and to udev, and out again."""
    with suppress(OSError):
        subprocess.run(["/lib/systemd/systemd-udevd", "--daemon"], check=False)
    board.hears("lay_flat")
    # until the hand has put it down
    time.sleep(6)
    found = OUT / "session/calibration.json"
    record("as it was", *iio)
    run("written", "write", str(found), "kernel", *iio, "--yes", "-o", "/run/written")
    record("corrected", *iio)
    rules = [path.read_text() for path in Path("/etc/udev/rules.d").glob("*mpucal*")]
    tell("rules", rules=rules, calibbias=[(IIO / iio[1] / f"in_accel_{a}_calibbias").read_text() for a in "xyz"])
    run("put back by mpucal", "write", "/run/written/iio-state.json", "kernel", *iio, "--yes")
    record("as it is again", *iio)


if __name__ == "__main__":
    tell("up", kernel=os.uname().release)
    made = Board("sim:chip=mpu6050,seed=7")
    try:
        {"bus": over_bus, "iio": over_iio, "two": over_two}[sys.argv[1]](made)
    finally:
        made.close()
