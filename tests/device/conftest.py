"""/dev/i2c-1 with a simulated chip behind it, for the installed command and for the tools of Linux."""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import struct
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

HARNESS = Path(__file__).parent / "harness"
# the words that harness/clock.c shares: the time; what was heard; what a worker was told and has done, and its process
WORDS, HEARD_AT, NOBODY_LISTENS = struct.Struct("<5q"), 8, -1
UPTIME_NS = 900 * 10**9
PRELOAD = "LD_PRELOAD"


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
    """A simulated chip at /dev/i2c-1, for the programs that `run` starts.

    Parameters
    ----------
    text : the chip, as --bus sim:... names it. clock : file and library of the time that only waiting takes.
    """

    def __init__(self, text: str, folder: Path, clock: Path) -> None:
        self.folder, time = folder, folder / "clock"
        # an uptime of a quarter of an hour: a monotonic clock does not begin at zero
        time.write_bytes(WORDS.pack(UPTIME_NS, NOBODY_LISTENS, 0, 0, 0))
        self._time = time
        command = [sys.executable, HARNESS / "device.py", text, time]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        mocked = json.loads(self._process.stdout.readline())
        self.root = Path(mocked["UMOCKDEV_DIR"])
        mocked[PRELOAD] = f"{clock}:{mocked[PRELOAD]}"
        self.environment = {**os.environ, **mocked, "MPUCAL_TEST_CLOCK": str(time)}

    def tell(self, **what) -> None:
        """Change the device, see harness/device.py."""
        self._process.stdin.write(json.dumps(what) + "\n")
        self._process.stdin.flush()
        self._process.stdout.readline()

    @contextmanager
    def but_for(self, adapter):
        """Another adapter for as long as the context lasts; see harness/adapter.py."""
        self.tell(adapter=adapter)
        try:
            yield
        finally:
            self.tell(adapter={"address": 0x68, "bound": [], "fails": 0})

    def run(self, *command) -> Result:
        """Any program."""
        words = [str(word) for word in command]
        done = subprocess.run(
            words, env=self.environment, cwd=self.folder, capture_output=True, text=True, check=False, timeout=120
        )
        return Result(done.returncode, done.stdout, done.stderr)

    def mpucal(self, *words) -> Result:
        """The installed command."""
        return self.run(Path(sys.executable).parent / "mpucal", *words)

    @contextmanager
    def recording(self, *words):
        """The command `record` meanwhile, once it has the chip."""
        capture = self.folder / "held.mcap"
        command = [Path(sys.executable).parent / "mpucal", "record", *words, "--seconds", "100000", "-o", capture]
        with subprocess.Popen(
            command, env=self.environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
        ) as process:
            try:
                process.stderr.readline()
                yield
            finally:
                process.kill()

    def session(self, *words) -> Result:
        """The same, guiding the simulated hand through a session; it may fail before."""
        self._share(0, told=0, worked=0, worker=0)
        command = [Path(sys.executable).parent / "mpucal", "session", "--bus", "/dev/i2c-1", "--json-events", *words]
        with subprocess.Popen(
            [str(word) for word in command],
            env=self.environment,
            cwd=self.folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        ) as process:
            said = b""
            for line in process.stderr:
                event = json.loads(line) if line.startswith(b"{") else {}
                if event.get("event") == "prompt":
                    self.tell(prompt={"kind": event["kind"], "down": event.get("down")})
                said += line
                self._share(len(said))
            out = process.stdout.read().decode()
            self._share(NOBODY_LISTENS, told=0, worked=0, worker=0)
            return Result(process.wait(), out, said.decode())

    def _share(self, heard: int, **worker: int) -> None:
        """So many bytes of what the program says were heard; see harness/clock.c."""
        words = struct.pack(f"<{1 + len(worker)}q", heard, *worker.values())
        with self._time.open("r+b") as file:
            file.seek(HEARD_AT)
            file.write(words)

    def forbid(self) -> None:
        """Let the kernel refuse to open the device file, to root as well: a setting of /proc that is read only."""
        node = self.root / "dev" / "i2c-1"
        node.unlink()
        node.symlink_to("/proc/sys/kernel/ostype")

    def configure(self, hz: int) -> None:
        """The speed that the device tree asks of the adapter."""
        node = self.root / "sys" / "class" / "i2c-dev" / "i2c-1" / "device" / "of_node"
        node.mkdir(parents=True)
        (node / "clock-frequency").write_bytes(hz.to_bytes(4, "big"))

    def close(self) -> None:
        self._process.stdin.close()
        self._process.wait(timeout=30)
        self._process.stdout.close()
        shutil.rmtree(self.root, ignore_errors=True)


@pytest.fixture(scope="session")
def clock(tmp_path_factory):
    """The library of harness/clock.c, built now."""
    for library in ("libumockdev.so.0", "libumockdev-preload.so.0"):
        try:
            # the second one is for other programs: found is enough
            ctypes.CDLL(library) if "preload" not in library else _find(library)
        except OSError:
            pytest.skip(f"{library} is missing: install Debian's umockdev, as tools/ci_packages does")
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("there is no C compiler for the clock of harness/clock.c")
    built = tmp_path_factory.mktemp("clock") / "clock.so"
    subprocess.run([compiler, "-O2", "-shared", "-fPIC", "-o", built, HARNESS / "clock.c", "-ldl"], check=True)
    return built


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
    """Makes a device; all are gone afterwards."""
    with _devices(clock) as make:
        yield make


@pytest.fixture(scope="module")
def device_of_module(clock):
    """The same for a device that several tests share."""
    with _devices(clock) as make:
        yield make
