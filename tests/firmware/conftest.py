from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
FIRMWARE = HERE.parents[1] / "tools" / "firmware"
SIMAVR = Path("/usr/include/simavr/sim_avr.h")


def _module(path: Path):
    spec = importlib.util.spec_from_file_location(f"firmware_{path.stem}", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def _need(*programs: str) -> None:
    missing = [program for program in programs if shutil.which(program) is None]
    if missing:
        pytest.skip(f"needs {' and '.join(missing)}, of the packages in tools/ci_packages.txt")


@pytest.fixture(scope="session")
def host():
    """The module that compiles and runs the firmware's core on this machine."""
    return _module(HERE / "host" / "core.py")


@pytest.fixture(scope="session")
def core(host, tmp_path_factory):
    """The firmware's core as a library of this machine."""
    _need("gcc")
    return host.build_core(tmp_path_factory.mktemp("core"))


@pytest.fixture(scope="session")
def avr_build(tmp_path_factory):
    """The folder with the firmware for the ATmega328P, and what its build said."""
    _need("avr-gcc", "make")
    folder = tmp_path_factory.mktemp("avr")
    made = subprocess.run(["make", "-C", str(FIRMWARE), f"BUILD={folder}"], capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr
    return folder, made.stdout


@pytest.fixture(scope="session")
def emulator(tmp_path_factory):
    """The modules of the emulated board and of a line to it, and the board's library between them."""
    _need("gcc")
    if not SIMAVR.exists():
        pytest.skip("needs libsimavr-dev, of the packages in tools/ci_packages.txt")
    module = _module(HERE / "emulator" / "board.py")
    library = module.build_library(tmp_path_factory.mktemp("board"))
    return module, library, _module(HERE / "emulator" / "port.py")
