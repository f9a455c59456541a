"""The portable core and header for each processor, with every warning an error."""

import subprocess
from pathlib import Path

import pytest

SOURCES = Path(__file__).parents[2] / "mpucal" / "firmware" / "src"
AVR = {name: ("avr-gcc", f"-mmcu={name}") for name in ("atmega328p", "atmega2560", "atmega32u4", "attiny1614")}
ARM = {
    "cortex-m0plus": ("arm-none-eabi-gcc", "-mcpu=cortex-m0plus", "-mthumb"),
    "cortex-m4f": ("arm-none-eabi-gcc", "-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard"),
}
RISCV = {"rv32imac": ("riscv64-unknown-elf-gcc", "-march=rv32imac", "-mabi=ilp32", "--specs=picolibc.specs")}
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Wdouble-promotion", "-Werror")
PROCESSORS = AVR | ARM | RISCV
# warnings depend on the family rather than the part: the gate compiles for the first part of each
FIRST = [next(iter(family)) for family in (AVR, ARM, RISCV)]
OPTIMISED = [
    pytest.param(name, option, marks=[] if (name, option) in [(first, "-Os") for first in FIRST] else pytest.mark.slow)
    for option, names in (("-Os", PROCESSORS), ("-O2", FIRST))
    for name in names
]


@pytest.mark.parametrize(("processor", "optimised"), OPTIMISED)
def test_the_core_compiles_without_a_warning(processor, optimised, tmp_path, need):
    compiler, *flags = PROCESSORS[processor]
    need(compiler)
    sources = [str(path) for path in sorted(SOURCES.glob("*.c"))]
    words = [compiler, "-std=c99", optimised, *flags, *WARNINGS, f"-I{SOURCES}", "-c", *sources]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert len(list(tmp_path.glob("*.o"))) == len(sources)


CORE = Path("/usr/share/arduino/hardware/arduino/avr")
BOARDS = {
    "AVR_UNO": ("atmega328p", "standard"),
    "AVR_MEGA2560": ("atmega2560", "mega"),
    "AVR_LEONARDO": ("atmega32u4", "leonardo"),
}
SKETCHES = ("mpucal_bridge", "mpucal_corrected")


@pytest.mark.parametrize("sketch", SKETCHES)
@pytest.mark.parametrize(
    "board", [pytest.param(name, marks=[] if name == "AVR_UNO" else pytest.mark.slow) for name in BOARDS]
)
def test_the_sketches_compile_without_a_warning_of_theirs(board, sketch, tmp_path, need):
    """Stricter than the IDE, which has no -Wconversion; the core itself does not pass with it."""
    need("avr-g++", CORE)
    mcu, variant = BOARDS[board]
    folders = (CORE / "cores/arduino", CORE / "variants" / variant, CORE / "libraries/Wire/src")
    named = {"F_CPU": "16000000UL", "ARDUINO": "10819", "DECIMAL_DIG": "__DECIMAL_DIG__", f"ARDUINO_{board}": "1"}
    named |= {"USB_VID": "0x2341", "USB_PID": "0x8036", "USB_MANUFACTURER": '"x"', "USB_PRODUCT": '"y"'}
    words = ["avr-g++", "-std=gnu++11", "-Os", "-fno-exceptions", f"-mmcu={mcu}", "-Wall", "-Wextra", "-Wconversion"]
    words += [f"-D{name}={value}" for name, value in named.items()]
    words += [f"-I{folder}" for folder in (*folders, CORE / "libraries/EEPROM/src", SOURCES)]
    source = SOURCES.parent / "examples" / sketch / f"{sketch}.ino"
    words += ["-include", "Arduino.h", "-x", "c++", "-c", str(source), "-o", str(tmp_path / "sketch.o")]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert [line for line in done.stderr.splitlines() if "warning:" in line and str(CORE) not in line] == []
