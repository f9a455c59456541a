"""The portable core and header for each processor, with every warning an error."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

SOURCES = Path(__file__).parents[2] / "tools" / "firmware" / "src"
AVR = {name: ("avr-gcc", f"-mmcu={name}") for name in ("atmega328p", "atmega2560", "atmega32u4", "attiny1614")}
ARM = {
    "cortex-m0plus": ("arm-none-eabi-gcc", "-mcpu=cortex-m0plus", "-mthumb"),
    "cortex-m4f": ("arm-none-eabi-gcc", "-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard"),
}
RISCV = {"rv32imac": ("riscv64-unknown-elf-gcc", "-march=rv32imac", "-mabi=ilp32", "--specs=picolibc.specs")}
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Wdouble-promotion", "-Werror")
PROCESSORS = AVR | ARM | RISCV


@pytest.mark.parametrize("optimised", ["-Os", "-O2"])
@pytest.mark.parametrize("processor", PROCESSORS)
def test_the_core_compiles_without_a_warning(processor, optimised, tmp_path):
    compiler, *flags = PROCESSORS[processor]
    if shutil.which(compiler) is None:
        pytest.skip(f"needs {compiler}, of the packages in tools/ci_packages.txt")
    sources = [str(path) for path in sorted(SOURCES.glob("*.c"))]
    words = [compiler, "-std=c99", optimised, *flags, *WARNINGS, f"-I{SOURCES}", "-c", *sources]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert len(list(tmp_path.glob("*.o"))) == len(sources)
