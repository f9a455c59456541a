import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

from mpucal.bridge.bus import BridgeBus
from mpucal.bridge.link import Link
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.simulated.chip import open_simulated

HERE = Path(__file__).parent
FIRMWARE = HERE.parents[1] / "mpucal" / "firmware"
ARDUINO = Path("/usr/share/arduino/hardware/arduino/avr")
SIMAVR = Path("/usr/include/simavr/sim_avr.h")


def _module(path: Path):
    spec = importlib.util.spec_from_file_location(f"firmware_{path.stem}", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def host():
    """Module that compiles and runs the firmware's core on this machine."""
    return _module(HERE / "host" / "core.py")


@pytest.fixture(scope="session")
def core(host, once, need):
    """Library of the firmware's core, compiled for this machine."""
    need("gcc")
    return host.load_core(once("firmware-core", host.compile_core))


@pytest.fixture(scope="session")
def make(once, need):
    """Makes a target of the firmware's Makefile: (folder, output)."""
    need("avr-gcc", "make")

    def run(target, *settings):
        def build(folder):
            words = ["make", "--no-print-directory", "-C", str(FIRMWARE), f"BUILD={folder}", *settings]
            made = subprocess.run([*words, target.format(folder)], capture_output=True, text=True, check=False)
            assert made.returncode == 0, made.stderr
            (folder / "said").write_text(made.stdout)

        name = "-".join((target.replace("/", "-"), *settings))
        folder = once(f"firmware-{name}", build)
        return folder, (folder / "said").read_text()

    return run


@pytest.fixture(scope="session")
def avr_build(make):
    """Builds the firmware for the ATmega328P at 500000 baud: (folder, output)."""
    return make("all", "BAUD=500000")


@pytest.fixture(scope="session")
def sketches(make, need):
    """Folder with the Arduino sketches, built for an Uno."""
    need(ARDUINO)
    return make("sketches")[0]


@pytest.fixture(scope="session")
def stock_sketches(make, need):
    """Builds the sketches as a stock Arduino IDE does for a board; returns their folder with the compiler's output."""
    need("arduino-builder", "arduino-ctags", ARDUINO)
    return lambda board: make(f"{{}}/stock/{board}")[0] / "stock" / board


@pytest.fixture(scope="session")
def emulator(once, need):
    """Modules of the emulated board, its library, and the line to it."""
    need("gcc", SIMAVR)
    module = _module(HERE / "emulator" / "board.py")
    library = module.load_library(once("firmware-board", module.compile_library))
    return module, library, _module(HERE / "emulator" / "port.py")


@pytest.fixture
def switch_on(emulator, avr_build, tmp_path):
    """Switches a board on, with an EEPROM that is kept: (board, port)."""
    module, library, port = emulator
    boards = []

    def power(chip=None, elf=avr_build[0] / "mpucal_bridge.elf", eeprom=tmp_path / "eeprom.bin"):
        clock = module.BoardClock()
        on_twi = chip(clock) if chip else open_simulated("sim:seed=1", clock=clock)
        board = module.Board(library, elf, eeprom, on_twi, clock)
        boards.append(board)
        board.run(0.001)
        return board, port.BoardPort(board)

    yield power
    for board in boards:
        board.cut_power()


@pytest.fixture(scope="session")
def greeted():
    """Greets the bridge on a port, and returns the link."""

    def greet(port):
        link = Link(port)
        link.greet()
        return link

    return greet


@pytest.fixture(scope="session")
def started():
    """Starts a driver on the bridge behind a port; `until(seconds)` polls it by the board's time."""

    class Started(Driver):
        def __init__(self, board, port, rate_hz):
            super().__init__(BridgeBus(port), Config(rate_hz=rate_hz))
            self.board, self.known = board, self.start()

        def until(self, seconds):
            while self.board.now_s < seconds:
                self.poll()
            return self.recording()

    return Started
