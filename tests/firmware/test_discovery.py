"""Build as the Arduino IDE does, which finds a library by an include that fails; judge what a sketch then holds."""

import subprocess
from pathlib import Path

import pytest

FIRMWARE = Path(__file__).parents[2] / "mpucal" / "firmware"
PLATFORM = """name=stub
version=1
compiler.path=
recipe.preproc.macros={cpp} {{includes}} -w -x c++ -E -CC "{{source_file}}" -o "{{preprocessed_file_path}}"
recipe.cpp.o.pattern={cpp} -Wall -Wextra {{includes}} -x c++ -c "{{source_file}}" -o "{{object_file}}"
recipe.c.o.pattern=gcc {flags} {{includes}} -c "{{source_file}}" -o "{{object_file}}"
recipe.ar.pattern=ar rcs "{{archive_file_path}}" "{{object_file}}"
recipe.c.combine.pattern=g++ -nostdlib -r {{object_files}} -o "{{build.path}}/{{build.project_name}}.elf"
"""
ARDUINO_H = """#pragma once
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#define LOW 0
#define OUTPUT 1
#define INPUT_PULLUP 2
unsigned long micros();
void delay(unsigned long);
void delayMicroseconds(unsigned);
void digitalWrite(int, int);
void pinMode(int, int);
void noInterrupts();
void interrupts();
struct Port {
    void begin(unsigned long); void setRxBufferSize(size_t); int available(); int read();
    size_t write(const uint8_t *, size_t); void print(const char *); void print(char); void print(float, int);
    void println(int);
};
extern Port Serial;
"""
WIRE_H = """#pragma once
#include <Arduino.h>
struct TwoWire {
    void begin(); void begin(int, int); void setSDA(int); void setSCL(int);
    void setClock(uint32_t); void beginTransmission(uint8_t); uint8_t endTransmission(bool = true);
    size_t write(uint8_t); uint8_t requestFrom(uint8_t, size_t); uint8_t requestFrom(int, int); int read();
};
extern TwoWire Wire;
"""
EEPROM_H = """#pragma once
#include <stdint.h>
struct EEPROMClass { uint8_t read(int); void update(int, uint8_t); };
extern EEPROMClass EEPROM;
"""
# as avr-libc has them for an ATmega4809
AVR = {
    "avr/io.h": "#pragma once\n#define EEPROM_START (0x1400)\n#define E2END (EEPROM_START + 0xFF)\n"
    "struct { unsigned char CTRLA; } WDT;\n"
    "#define WDT_PERIOD_2KCLK_gc 9\n#define _PROTECTED_WRITE(reg, value) ((reg) = (value))\n",
    "avr/wdt.h": "#pragma once\n#include <avr/io.h>\n#define wdt_reset()\n",
}
LARGE = AVR | {"avr/io.h": AVR["avr/io.h"].replace("0xFF", "0x3FF")}
# core -> what its compiler defines, what lies in its toolchain, and the symbol of the storage that the sketch holds
CORES = {
    "esp32": ("-DESP32", {}, "LittleFS"),
    "esp8266": ("-DESP8266 -DMPUCAL_SDA=4 -DMPUCAL_SCL=5", {}, "LittleFS"),
    "rp2040": ("-DARDUINO_ARCH_RP2040 -DMPUCAL_SDA=4 -DMPUCAL_SCL=5", {}, "LittleFS"),
    "mbed_rp2040": ("-DARDUINO_ARCH_RP2040 -DARDUINO_ARCH_MBED", {}, None),
    "megaavr": ("-D__AVR__", AVR, None),
    "megaavr_large": ("-D__AVR__", LARGE, "EEPROM"),
}
CTAGS = {
    "path": "/usr/bin",
    "cmd.path": "/usr/bin/arduino-ctags",
    "pattern": '"{cmd.path}" -u --language-force=c++ -f - --c++-kinds=svpf --fields=KSTtzns --line-directives'
    ' "{source_file}"',
}
# the only core of the quick gate
ONCE = ("esp32",)


def _put(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def _core(folder, name):
    """A core of stubs, as boards manager would have unpacked it."""
    flags, toolchain, _ = CORES[name]
    core = folder / "hardware" / "stub" / name
    for file, text in toolchain.items():
        _put(folder / "toolchain" / file, text)
    flags = f"{flags} -I{folder / 'toolchain'}"
    _put(core / "platform.txt", PLATFORM.format(cpp=f"g++ -std=gnu++17 {flags}", flags=flags))
    _put(core / "boards.txt", "board.name=board\nboard.build.core=stub\n")
    _put(core / "cores" / "stub" / "Arduino.h", ARDUINO_H)
    _put(core / "cores" / "stub" / "main.cpp", "#include <Arduino.h>\n")
    for library, header in (("Wire", WIRE_H), ("EEPROM", EEPROM_H)):
        _put(core / "libraries" / library / f"{library}.h", header)
    header = (Path(__file__).parent / "host" / "littlefs" / "LittleFS.h").read_text()
    _put(core / "libraries" / "LittleFS" / "LittleFS.h", f"#pragma once\n#include <Arduino.h>\n{header}")


@pytest.mark.parametrize("name", [pytest.param(name, marks=[] if name in ONCE else pytest.mark.slow) for name in CORES])
def test_the_built_sketch_holds_the_storage_of_its_core(name, tmp_path, need):
    need("arduino-builder", "arduino-ctags", "g++", "nm")
    _core(tmp_path, name)
    (tmp_path / "libraries").mkdir()
    (tmp_path / "libraries" / "mpucal").symlink_to(FIRMWARE)
    (tmp_path / "build").mkdir()
    words = ["arduino-builder", "-compile", "-hardware", tmp_path / "hardware", "-tools", "/usr/bin"]
    words += ["-libraries", tmp_path / "libraries", "-fqbn", f"stub:{name}:board", "-build-path", tmp_path / "build"]
    words += [f"-prefs=tools.ctags.{key}={value}" for key, value in CTAGS.items()]
    sketch = FIRMWARE / "examples" / "mpucal_bridge" / "mpucal_bridge.ino"
    done = subprocess.run([*words, sketch], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "mpucal" not in "".join(line for line in done.stderr.splitlines() if "warning:" in line)
    made = tmp_path / "build" / "sketch" / "mpucal_bridge.ino.cpp.o"
    symbols = subprocess.run(["nm", "-C", made], capture_output=True, text=True, check=True).stdout
    storage = CORES[name][2]
    held = {library for library in ("LittleFS", "EEPROM") if f" U {library}\n" in symbols}
    assert held == ({storage} if storage else set())
