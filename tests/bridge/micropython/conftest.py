"""MicroPython itself, in node, on a port whose time runs only while the host waits."""

import contextlib
import subprocess
from pathlib import Path

import pytest

from mpucal.bridge.port import Chunk
from mpucal.errors import BusError
from mpucal.simulated.chip.bus import FastClock

ROOT = Path(__file__).parents[3]
PACKAGE, VERSION = "@micropython/micropython-webassembly-pyscript", "1.27.0"
# time between two looks of the bridge, and the most bytes that it is given at once
STEP_NS, MOST = 10_000_000, 255
TICKS = 2**30
ENODEV = 19
# from MicroPython's documentation of the raw REPL: the request for raw paste, and the size of its window
RAW_PASTE, WINDOW = b"\x05A\x01", 128


@pytest.fixture(scope="session")
def micropython(once, need):
    """Folder of MicroPython for node, which npm installs below build/, once in a run."""
    need("node", "npm")
    folder = ROOT / "build" / "node"
    package = folder / "node_modules" / PACKAGE
    if not (package / "micropython.wasm").is_file():
        folder.mkdir(parents=True, exist_ok=True)
        once("micropython", lambda _: _install(folder))
    if not (package / "micropython.wasm").is_file():
        pytest.skip(f"needs {PACKAGE} from npm")
    return package


def _install(folder):
    # without a network npm would wait for minutes
    quickly = ["--no-audit", "--no-fund", "--fetch-retries", "1", "--fetch-retry-mintimeout", "1000"]
    words = ["npm", "install", *quickly, "--prefix", str(folder), f"{PACKAGE}@{VERSION}"]
    with contextlib.suppress(subprocess.TimeoutExpired):
        subprocess.run(words, capture_output=True, check=False, timeout=60, cwd=folder)


class NodeBoard:
    """A Port at whose other end MicroPython runs; its clock is the chip's.

    Attributes
    ----------
    chip : a bus on the board's I2C(0); None: nothing is connected.
    raw_paste : MicroPython in node has no raw paste; if True, this class frees the window and passes on what was
        pasted.
    busy : True until Ctrl-C comes: a main.py runs.
    """

    name, bauds = "the board", (115_200,)

    def __init__(self, package, chip, clock, raw_paste=True, busy=False):
        self.chip, self._clock, self._raw_paste, self._busy = chip, clock, raw_paste, busy
        self._pasted, self._room = None, 0
        words = ["node", str(Path(__file__).with_name("board.mjs")), str(package)]
        self._node = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self._input, self._output, self._waits = bytearray(), bytearray(), False

    def now_ns(self):
        return self._clock.now()

    def read(self, until_ns):
        while True:
            if self._output:
                data, self._output = bytes(self._output), bytearray()
                return Chunk(data, self.now_ns())
            if self.now_ns() >= until_ns:
                return None
            if self._waits and not self._input:
                self._clock.sleep_until(until_ns)
            elif self._waits:
                self._waits = False
                data, self._input = bytes(self._input[:MOST]), self._input[MOST:]
                self._answer(bytes([len(data)]) + data)
            else:
                self._serve()

    def write(self, data):
        if self._busy:
            self._busy, data = b"\x03" not in data, data.partition(b"\x03")[2]
        if self._pasted is not None:
            self._paste(data)
        elif data != RAW_PASTE or not self._raw_paste:
            self._input += data
        else:
            self._output += b"R\x01" + WINDOW.to_bytes(2, "little") + b"\x01"
            self._pasted, self._room = b"", 2 * WINDOW

    def _paste(self, data):
        self._input += data
        if data == b"\x04":
            return
        assert len(data) <= self._room, "more than there is room for"
        freed = (len(self._pasted) + len(data)) // WINDOW - len(self._pasted) // WINDOW
        self._pasted += data
        self._room += freed * WINDOW - len(data)
        self._output += b"\x01" * freed

    def set_baud(self, baud):
        pass

    def reopen(self, until_ns):
        pass

    def close(self):
        """The port; the board runs on."""

    def switch_off(self):
        self._node.stdin.close()
        self._node.wait(10)
        self._node.stdout.close()

    def _serve(self):
        kind, low, high = self._node.stdout.read(3)
        data = self._node.stdout.read(low | high << 8)
        match chr(kind):
            case "w":
                if self._pasted is not None and data.startswith(b"OK"):
                    # the raw mode confirms a program by OK, raw paste by Ctrl-D
                    self._pasted, data = None, b"\x04" + data[2:]
                self._output += data
            case "g":
                self._waits = True
            case "p":
                if not self._input:
                    self._clock.sleep_until(self._clock.now() + STEP_NS)
                self._answer(bytes([bool(self._input)]))
            case "t":
                self._answer((self._clock.now() // 1000 % TICKS).to_bytes(4, "little"))
            case "i":
                answer = self._moved(*data[:3], data[3:])
                self._answer(bytes([len(answer)]) + answer)

    def _moved(self, address, register, count, data):
        if self.chip is None or address != 0x68:
            return bytes([ENODEV])
        try:
            if data:
                self.chip.write(register, data)
                return b"\0"
            return b"\0" + (self.chip.read(register, count).data if count else b"")
        except BusError:
            return bytes([110])

    def _answer(self, data):
        self._node.stdin.write(data)
        self._node.stdin.flush()


@pytest.fixture
def board(micropython):
    """Switches a board on: MicroPython with a chip."""
    boards = []

    def switch_on(chip=None, clock=None, **how):
        boards.append(NodeBoard(micropython, chip, clock or FastClock(), **how))
        return boards[-1]

    yield switch_on
    for each in boards:
        each.switch_off()
