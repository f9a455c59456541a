"""Runs in the kernel that boot.py starts: what mpucal does there, a line of JSON each."""

from __future__ import annotations

import ctypes
import json
import mmap
import os
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import smbus2
from click.testing import CliRunner

import mpucal
from mpucal import cli
from mpucal.errors import MpucalError

IIO, I2C = Path("/sys/bus/iio/devices"), Path("/sys/bus/i2c/devices")
EEPROM = 0x57
# QEMU's adapter gives 0 for the last byte of a block: of the FIFO's count, and of a frame
FRAMES, GYRO_Z = 18, -3072
LOADED = ["/bin/busybox", "insmod"]


def tell(step: str, **facts: Any) -> None:
    up = float(Path("/proc/uptime").read_text().split()[0])
    print("SAID " + json.dumps({"step": step, "up": up, **facts}), flush=True)


def run(step: str, *words: str, **facts: Any) -> str:
    """One command of mpucal, in this process: each start of another takes seconds here."""
    ran = CliRunner().invoke(cli.commands, list(words), standalone_mode=False)
    error = ran.exception
    sentence = str(error) if isinstance(error, MpucalError) else repr(error) if error else ""
    code = ran.return_value if error is None else sentence
    tell(step, code=code, output=ran.stdout, said=ran.stderr[-2000:], **facts)
    return ran.stdout


def wait_for(there: Callable[[], Any], seconds: float = 150.0) -> Any:
    end = time.monotonic() + seconds
    while not (found := there()) and time.monotonic() < end:
        time.sleep(0.1)
    return found


def adapter_named(part: str) -> Path:
    return wait_for(lambda: next((p.parent for p in I2C.glob("i2c-*/name") if part in p.read_text()), None))


def device_of(client: str) -> Path:
    return wait_for(lambda: next(iter((I2C / client).glob("iio:device*")), None))


def summary(path: Path) -> dict[str, Any]:
    if not path.exists():
        return {"samples": 0}
    recording = mpucal.load(path)
    acc, gyr = recording.acc, recording.gyr
    return {
        "samples": len(recording),
        "rate_hz": recording.rate_hz,
        "steps_ms": [float(v) * 1e3 for v in np.percentile(np.diff(recording.t), (0, 50, 100))],
        "acc": acc.mean(0).tolist(),
        "gyr": gyr.mean(0).tolist(),
        "first": acc[0].tolist(),
        "sensor": vars(recording.sensor),
    }


def live() -> None:
    """The simulated chip on a real adapter: by --bus, then held by the kernel's own driver."""
    program = [sys.executable, str(Path(__file__).parent / "adapter.py"), "sim:pace=real,hand=still,seed=4"]
    with subprocess.Popen(program) as adapter:
        try:
            bus = adapter_named("i2c-tiny-usb").name.removeprefix("i2c-")
            run("recorded", "record", "--bus", bus, "--rate", "50", "--seconds", "4", "-o", "/run/bus.mcap")
            tell("recording", **summary(Path("/run/bus.mcap")))
            (I2C / f"i2c-{bus}" / "new_device").write_text("mpu6050 0x68")
            if not Path("/sys/bus/i2c/drivers/inv-mpu6050-i2c").exists():
                subprocess.run([*LOADED, "/modules/inv-mpu6050-i2c.ko"], check=True)
            device = device_of(f"{bus}-0068")
            tell("bound", device=device.name, names=sorted(p.name for p in device.iterdir()))
            run("held", "record", "--bus", bus, "--seconds", "1", "-o", "/run/held.mcap")
            run("polled", "record", "--iio", device.name, "--rate", "50", "--seconds", "4", "-o", "/run/polled.mcap")
            tell("polled recording", **summary(Path("/run/polled.mcap")))
            run("examined", "doctor", "--iio", device.name, "--seconds", "3", "--rate", "50", "--json")
            calibbias(device)
            (I2C / f"i2c-{bus}" / "delete_device").write_text("0x68")
            run("doctor", "doctor", "--bus", bus, "--seconds", "2", "--rate", "50", "--json")
        finally:
            adapter.kill()


def calibbias(device: Path) -> None:
    """Written through the kernel and read back."""
    names = [f"in_accel_{axis}_calibbias" for axis in "xyz"]
    before = [int((device / name).read_text()) for name in names]
    for name, word in zip(names, before, strict=True):
        (device / name).write_text(str(word + 100))
    tell("calibbias", before=before, after=[int((device / name).read_text()) for name in names])


def buffered() -> None:
    """The kernel's own driver with an interrupt: its buffer, and the case in which it stays empty."""
    bus = int(adapter_named("SMBus I801").name.removeprefix("i2c-"))
    registers = smbus2.SMBus(bus, force=True)

    def put(register: int, *values: int) -> None:
        for i, value in enumerate(values):
            registers.write_byte_data(EEPROM, register + i, value, force=True)

    put(0x75, 0x68)
    put(0x6B, 0x40)
    subprocess.run([*LOADED, "/modules/inv-mpu6050-i2c.ko"], check=True)
    device = wait_for(lambda: next(iter(IIO.glob("iio:device*")), None))
    tell("probed", name=(device / "name").read_text().strip(), buffer=(device / "buffer").is_dir())
    pulse, stop = _interrupt(), threading.Event()
    state = {"ready": 1, "count": 0}

    def measure() -> None:
        next_s = time.monotonic()
        while not stop.is_set():
            n = state["count"] = state["count"] + 1
            with suppress(OSError):
                put(0x74, *struct.pack(">7h", n, -n, 8192 + n, 0, 1000 + n, 2000, GYRO_Z))
                put(0x00, state["ready"])
                put(0x72, 1, 0)
                pulse()
            next_s += FRAMES / 50
            time.sleep(max(0.0, next_s - time.monotonic()))

    measuring = threading.Thread(target=measure, daemon=True)
    measuring.start()
    words = ["record", "--iio", device.name, "--rate", "50", "--seconds", "4"]
    run("buffered", *words, "-o", "/run/buffer.mcap")
    if Path("/run/buffer.mcap").exists():
        tell("buffered recording", **summary(Path("/run/buffer.mcap")))
    tell("put back", enable=(device / "buffer/enable").read_text(), rate=(device / "sampling_frequency").read_text())
    other = os.open(f"/dev/{device.name}", os.O_RDONLY | os.O_NONBLOCK)
    run("another reader", *words, "-o", "/run/other.mcap")
    os.close(other)
    state["ready"] = 0
    run("empty", *words, "-o", "/run/empty.mcap")
    stop.set()
    measuring.join()


def _interrupt() -> Callable[[], None]:
    """Raises and lowers the line of QEMU's edu device."""
    folder = Path("/sys/bus/pci/devices/0000:00:04.0")
    with (folder / "config").open("r+b", buffering=0) as config:
        config.seek(4)
        config.write(b"\x02\x00")
    memory = mmap.mmap(os.open(folder / "resource0", os.O_RDWR | os.O_SYNC), 4096)
    up, down = (ctypes.c_uint32.from_buffer(memory, at) for at in (0x60, 0x64))

    def pulse() -> None:
        up.value = 1
        down.value = 1

    return pulse


if __name__ == "__main__":
    tell("up", kernel=os.uname().release)
    for part in (buffered, live):
        if not sys.argv[1:] or part.__name__ in sys.argv[1:]:
            part()
