"""Program in the kernel that conftest.py boots: mpucal's commands, reported in lines of JSON, with files in OUT."""

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
    """Print a line for the test, with the time since the kernel's start."""
    up = float(Path("/proc/uptime").read_text().split()[0])
    print("SAID " + json.dumps({"step": step, "up": up, **facts}), flush=True)


def run(step: str, *words: str, **facts: Any) -> str:
    """Run one command of mpucal in this process: to start another takes seconds here."""
    ran = CliRunner().invoke(cli.commands, list(words), standalone_mode=False)
    error = ran.exception
    sentence = str(error) if isinstance(error, MpucalError) else repr(error) if error else ""
    tell(step, code=ran.return_value or 0 if error is None else sentence, out=ran.stdout, said=ran.stderr, **facts)
    return ran.stdout


def record(step: str, *words: str, seconds: float = 4) -> None:
    """Run `mpucal record` into a file in OUT that has the step's name."""
    run(step, "record", *words, *RATE, "--seconds", str(seconds), "-o", str(OUT / f"{step}.mcap"))


def wait_for(find: Callable[[], Any], seconds: float = 60.0) -> Any:
    """Return the first true result of `find` within `seconds` of the guest's time."""
    end = time.monotonic() + seconds
    while not (found := find()) and time.monotonic() < end:
        time.sleep(0.1)
    if not found:
        raise TimeoutError(f"waited {seconds:g} s")
    return found


def later(seconds: float, action: Callable[[], Any]) -> None:
    """Call `action` after `seconds`, while a command runs."""
    Timer(seconds, action).start()


class Board:
    """Two simulated chips in a hand, behind a real adapter; see adapter.py.

    Attributes
    ----------
    bus : number of the adapter. rate_hz : the chips' own rate at a nominal 50 Hz.
    """

    def __init__(self, text: str) -> None:
        program = [sys.executable, str(HERE / "adapter.py"), text]
        self._process = subprocess.Popen(program, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        truth = json.loads(self._process.stdout.readline())
        tell("truth", **truth)
        self.rate_hz = 50 * (1 + truth["rate_error_ppm"] * 1e-6)
        names = wait_for(lambda: [p for p in I2C.glob("devices/i2c-*/name") if "i2c-tiny-usb" in p.read_text()])
        self.bus = names[0].parent.name.removeprefix("i2c-")

    def prompt(self, kind: str, down: Any = None) -> None:
        """Send a prompt to the hand."""
        self._send(prompt={"kind": kind, "down": down})

    def register_0(self, address: int, value: int) -> None:
        """Set the content of a chip's register 0."""
        self._send(address=address, register_0=value)
        # There is no answer; it is done long before a command reads the register.
        time.sleep(0.1)

    def session(self, step: str, *words: str) -> None:
        """Run a whole session whose prompts the hand obeys; copy its folder to OUT."""
        folder = f"/run/{step.replace(' ', '-')}"
        command = [str(MPUCAL), "session", *words, *RATE, "--target", "quick", "--yes", "--json-events", "-o", folder]
        said = []
        with subprocess.Popen(command, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
            for line in process.stderr:
                event = json.loads(line) if line.startswith("{") else {"event": "line", "what": line}
                if event["event"] == "prompt":
                    self.prompt(event["kind"], event.get("down"))
                if event["event"] in ("line", "error", "note", "prompt"):
                    said.append(event)
        subprocess.run(["cp", "-r", folder, OUT], check=False)
        tell(step, code=process.wait(), said=said)

    def unplug(self) -> None:
        """Unplug the adapter."""
        DETACH.write_text("0")

    def close(self) -> None:
        """End the chips."""
        self._process.kill()
        self._process.wait()

    def _send(self, **what: Any) -> None:
        self._process.stdin.write(json.dumps(what) + "\n")
        self._process.stdin.flush()


def over_bus(board: Board) -> None:
    """Use the real /dev/i2c-N."""
    bus = ("--bus", board.bus)
    board.prompt("lay_flat")
    run("doctor", "doctor", *bus, "--seconds", "2", *RATE, "--json")
    record("recorded", *bus)
    board.session("session", *bus)
    board.prompt("lay_flat")
    later(3, board.unplug)
    record("unplugged", *bus, seconds=20)


def over_iio(board: Board) -> None:
    """Use the kernel's own driver, with an interrupt."""
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
    later(2, stop_for_four_seconds)
    record("overrun", *iio, seconds=8)
    board.session("session", *iio)
    write_and_restore(board, iio)
    later(2, lambda: (I2C / "drivers/inv-mpu6050-i2c/unbind").write_text(client))
    record("unbound", *iio, seconds=20)


def over_two(board: Board) -> None:
    """Use the accelerometer and the gyroscope of two devices."""
    accel, gyro = bound(board)
    board.session("session", "--iio", f"accel={accel},gyro={gyro}")


def bound(board: Board) -> list[str]:
    """Bind the kernel's driver to the chips, as on a board with INT wires; return the devices."""
    board.prompt("lay_flat")
    addresses = ",".join(f"0x{address}" for address in ADDRESSES)
    wires = [f"adapter={board.bus}", f"addresses={addresses}", f"period_us={round(1e6 / board.rate_hz)}"]
    subprocess.run(["/bin/busybox", "insmod", "/modules/interrupt.ko", *wires], check=True)
    clients = [I2C / "devices" / f"{board.bus}-{address}" for address in ADDRESSES]
    return [wait_for(lambda c=c: [path.name for path in c.glob("iio:device*")])[0] for c in clients]


def stop_for_four_seconds() -> None:
    """Stop this process for four seconds; the kernel goes on, and its buffer holds two."""
    subprocess.Popen(["/bin/sh", "-c", f"sleep 4; kill -CONT {os.getpid()}"])
    os.kill(os.getpid(), 19)


def write_and_restore(board: Board, iio: tuple[str, str]) -> None:
    """Write a session's calibration to calibbias and udev, and put the old state back."""
    with suppress(OSError):
        subprocess.run(["/lib/systemd/systemd-udevd", "--daemon"], check=False)
    board.prompt("lay_flat")
    # The hand needs so long to put it down.
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
