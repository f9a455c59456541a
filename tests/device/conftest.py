"""Fixtures: /dev/i2c-1 with a simulated chip, for the installed command and for the tools of Linux."""

import ctypes
import json
import os
import shutil
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

HARNESS = Path(__file__).parent / "harness"
UPTIME_NS = 900 * 10**9
PRELOAD = "LD_PRELOAD"
INSTALLED = Path(sys.executable).parent / "mpucal"
# the clock waits for one process alone
IN_ONE = (
    sys.executable,
    "-c",
    "from mpucal.sources import chip; chip.CAN_FORK = False; from mpucal.__main__ import main; main()",
)


@dataclass(frozen=True)
class Result:
    code: int
    out: str
    err: str

    @property
    def sentences(self) -> list[str]:
        events = [json.loads(line) for line in self.err.splitlines() if line.startswith("{")]
        said = [f"mpucal: {event['what']}: {event['remedy']}" for event in events if event["event"] == "error"]
        return said + [line for line in self.err.splitlines() if line.startswith("mpucal: ")]


class Device:
    """Simulated chip at /dev/i2c-1, for the programs that `run` starts.

    Parameters
    ----------
    text : the chip, as --bus sim:... names it. clock : file and library of the time that only waiting takes.
    """

    def __init__(self, text: str, folder: Path, clock: Path) -> None:
        self.folder, time = folder, folder / "clock"
        # an uptime of a quarter of an hour: a monotonic clock does not begin at zero
        time.write_bytes(UPTIME_NS.to_bytes(8, "little"))
        command, pipe = [sys.executable, HARNESS / "device.py", text, time], subprocess.PIPE
        self._device = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True)
        mocked = json.loads(self._device.stdout.readline())
        self.root = Path(mocked["UMOCKDEV_DIR"])
        mocked[PRELOAD] = f"{clock}:{mocked[PRELOAD]}"
        self.environment = {**os.environ, **mocked, "MPUCAL_TEST_CLOCK": str(time)}

    def tell(self, **what) -> None:
        """Change the device, see harness/device.py."""
        print(json.dumps(what), file=self._device.stdin, flush=True)
        self._device.stdout.readline()

    @contextmanager
    def but_for(self, adapter):
        """Change the adapter during a `with` block; see harness/adapter.py."""
        self.tell(adapter=adapter)
        try:
            yield
        finally:
            self.tell(adapter={"address": 0x68, "bound": [], "fails": 0})

    def run(self, *command) -> Result:
        """Run a program."""
        words = [str(word) for word in command]
        done = subprocess.run(
            words, env=self.environment, cwd=self.folder, capture_output=True, text=True, check=False, timeout=120
        )
        return Result(done.returncode, done.stdout, done.stderr)

    def installed(self, *words) -> Result:
        """Run the installed command."""
        return self.run(INSTALLED, *words)

    def mpucal(self, *words) -> Result:
        """Run the command in one process."""
        return self.run(*IN_ONE, *words)

    @contextmanager
    def recording(self, *words):
        """Run the command `record` during a `with` block, which begins once it has the chip."""
        command = [*IN_ONE, "record", *words, "--seconds", "100000", "-o", self.folder / "held.mcap"]
        null, pipe = subprocess.DEVNULL, subprocess.PIPE
        with subprocess.Popen(command, env=self.environment, stdin=null, stdout=null, stderr=pipe) as program:
            try:
                # it records as fast as it can; a process that is stopped within an ioctl would block the device
                program.stderr.readline()
                yield
            finally:
                program.kill()

    def forbid(self) -> None:
        """Make the kernel refuse to open the device file, even for root: it becomes a read-only setting of /proc."""
        node = self.root / "dev" / "i2c-1"
        node.unlink()
        node.symlink_to("/proc/sys/kernel/ostype")

    def configure(self, hz: int) -> None:
        """Set the adapter's speed in the device tree."""
        node = self.root / "sys" / "class" / "i2c-dev" / "i2c-1" / "device" / "of_node"
        node.mkdir(parents=True)
        (node / "clock-frequency").write_bytes(hz.to_bytes(4, "big"))

    def close(self) -> None:
        self._device.communicate()
        shutil.rmtree(self.root, ignore_errors=True)


@pytest.fixture(scope="session")
def clock(once, need):
    """Library of harness/clock.c, built once."""
    for library in ("libumockdev.so.0", "libumockdev-preload.so.0"):
        try:
            # the second one is preloaded by other programs: it is only looked for
            ctypes.CDLL(library) if "preload" not in library else _find(library)
        except OSError:
            pytest.skip(f"{library} is missing: install Debian's umockdev, as tools/ci_packages does")
    need("cc")
    command = ["cc", "-O2", "-shared", "-fPIC", "-o", "clock.so", HARNESS / "clock.c", "-ldl"]
    return once("device-clock", lambda folder: subprocess.run(command, cwd=folder, check=True)) / "clock.so"


def _find(library):
    done = subprocess.run(["/bin/true"], env={PRELOAD: library}, capture_output=True, text=True, check=True)
    if done.stderr:
        raise OSError(done.stderr)


@contextmanager
def _devices(clock: Path):
    made = []

    def make(text: str = "sim") -> Device:
        folder = Path(tempfile.mkdtemp(prefix="mpucal-device-"))
        made.append(Device(text, folder, clock))
        return made[-1]

    yield make
    for each in made:
        each.close()
        shutil.rmtree(each.folder, ignore_errors=True)


@pytest.fixture
def device(clock):
    """Makes a device, and removes it after the test."""
    with _devices(clock) as make:
        yield make


@pytest.fixture(scope="module")
def sound(clock):
    """A device without faults, which the tests of a module share; a test that changes it restores it."""
    with _devices(clock) as make:
        yield make("sim:seed=3")
