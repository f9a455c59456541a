"""Fixtures: /dev/i2c-1 with a simulated chip, for the installed command and for the tools of Linux."""

import ctypes
import importlib.util
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

HARNESS = Path(__file__).parent / "harness"
UPTIME_NS = 900 * 10**9
PRELOAD = "LD_PRELOAD"
INSTALLED = Path(sys.executable).parent / "mpucal"
# packages that commands import on demand
COMMANDS = [
    f"mpucal.{room}" for room in ("cli", "doctor", "calibration", "chip", "files", "report", "session", "sinks")
]
COMMAND = "from mpucal.__main__ import main; main()"
DEVICE = "import sys, device; device.main(*sys.argv[1:])"
MODULE = importlib.util.spec_from_file_location("device_forks", HARNESS / "forks.py")
forks = importlib.util.module_from_spec(MODULE)
MODULE.loader.exec_module(forks)


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
    devices, programs : start device.py, and what finds that device.
    """

    def __init__(self, text: str, folder: Path, clock: Path, devices, programs) -> None:
        self.folder, time, self.programs = folder, folder / "clock", programs
        # an uptime of a quarter of an hour: a monotonic clock does not begin at zero
        time.write_bytes(UPTIME_NS.to_bytes(8, "little"))
        (there, to), (out, back) = os.pipe(), os.pipe()
        self._to, self._from, files = os.fdopen(to, "wb"), os.fdopen(out, "rb"), [there, back, sys.__stderr__.fileno()]
        self._device = devices.start(
            DEVICE, "device.py", text, time, folder=folder, environment=dict(os.environ), files=files
        )
        os.close(there)
        os.close(back)
        mocked = json.loads(self._from.readline())
        self.root = Path(mocked["UMOCKDEV_DIR"])
        mocked[PRELOAD] = f"{clock}:{mocked[PRELOAD]}"
        self.environment = {**os.environ, **mocked, "MPUCAL_TEST_CLOCK": str(time)}

    def tell(self, **what) -> None:
        """Change the device, see harness/device.py."""
        self._to.write(json.dumps(what).encode() + b"\n")
        self._to.flush()
        self._from.readline()

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
        """Run the command in a process that has loaded mpucal already."""
        with self.program(COMMAND, INSTALLED, *words) as (program, out, err), ThreadPoolExecutor(1) as reader:
            said = reader.submit(err.read)
            heard = out.read()
            return Result(program.wait(), heard.decode(), said.result().decode())

    @contextmanager
    def program(self, code, *argv):
        """Run Python's `code` as the main program; yield it, its stdout and its stderr."""
        with Path(os.devnull).open() as nothing:
            pipes = [os.pipe() for _ in range(2)]
            files = [nothing.fileno(), *(write for _, write in pipes)]
            program = self.programs.start(code, *argv, folder=self.folder, environment=self.environment, files=files)
        for _, write in pipes:
            os.close(write)
        with os.fdopen(pipes[0][0], "rb") as out, os.fdopen(pipes[1][0], "rb") as err:
            yield program, out, err

    @contextmanager
    def recording(self, *words):
        """Run the command `record` during a `with` block, which begins once it has the chip."""
        capture = self.folder / "held.mcap"
        command = ("record", *words, "--seconds", "100000", "-o", capture)
        with self.program(COMMAND, INSTALLED, *command) as (program, _, err):
            try:
                # it records as fast as it can; a process that is stopped within an ioctl would block the device
                err.readline()
                yield
            finally:
                os.kill(program.pid, signal.SIGKILL)
                program.wait()

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
        self._to.close()
        self._device.wait()
        self._from.close()
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


@pytest.fixture(scope="session")
def loaded(clock):
    """Start two forking processes: one for devices, one for the programs that use them."""
    preloaded = f"{clock}:libumockdev-preload.so.0"
    of_programs = {**os.environ, PRELOAD: preloaded, "MPUCAL_TEST_CLOCK": ""}
    both = forks.Forks(dict(os.environ), "device"), forks.Forks(of_programs, *COMMANDS)
    yield both
    for each in both:
        each.close()


def _find(library):
    done = subprocess.run(["/bin/true"], env={PRELOAD: library}, capture_output=True, text=True, check=True)
    if done.stderr:
        raise OSError(done.stderr)


@contextmanager
def _devices(clock: Path, loaded):
    made = []

    def make(text: str = "sim") -> Device:
        folder = Path(tempfile.mkdtemp(prefix="mpucal-device-"))
        made.append(Device(text, folder, clock, *loaded))
        return made[-1]

    yield make
    for each in made:
        each.close()
        shutil.rmtree(each.folder, ignore_errors=True)


@pytest.fixture
def device(clock, loaded):
    """Makes a device, and removes it after the test."""
    with _devices(clock, loaded) as make:
        yield make


@pytest.fixture(scope="module")
def sound(clock, loaded):
    """A device without faults, which the tests of a module share; a test that changes it restores it."""
    with _devices(clock, loaded) as make:
        yield make("sim:seed=3")
