"""A kernel driver as a sink: b_a in calibbias of an MPU-6050, D as udev's ACCEL_MOUNT_MATRIX.

calibbias of inv_mpu6050 are the words of the accelerometer's offset registers, 2048 for 1 g; for an MPU-6500 the driver
writes y and z to wrong addresses, so they are not used there. iio-sensor-proxy multiplies the channels, at the scale
that the driver prints, by ACCEL_MOUNT_MATRIX instead of the device tree's matrix M: M inv(D) scale / printed.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..chip.config import Config
from ..chip.offsets import Words
from ..chip.port import Port
from ..chip.quick_measure import PATIENCE
from ..data import AXES, Vector
from ..disk.atomic import write_atomically
from ..errors import ChipError, OutputError
from ..export.offset_words import LSB_PER_G, matrix_text, offset_words
from ..iio.attributes import ACCEL, mount_matrix, read_scale
from ..iio.decode import IioDecoder
from ..iio.driver import IioDriver
from ..iio.setup import POLLED, DeviceSetup
from ..rests.stillness import is_untouched
from ..result.calibration import Calibration
from ..result.error_model import mg_text
from ..result.journal import Journal
from ..session.lay_flat import put_down
from ..session.ports import measured
from ..sinks.chip import check_shift, subtraction
from ..sinks.kind import Applied, Device, Sink
from ..sinks.old_state import check_accepted, load_state, not_a_state, nothing_written, restore_on_failure, save_state
from ..sinks.table import IIO_STATE, KERNEL
from .source import OpenedIio

FORMAT, WORDS, RULE = "mpucal.iio_state", "calibbias", "rule"
CALIBBIAS = [f"{ACCEL}_{axis}_calibbias" for axis in AXES]


@contextmanager
def open_kernel(device: Device) -> Iterator[KernelSink]:
    """Open the devices of --iio, after asking the user to put the board down.

    Raises
    ------
    BusError : there are no such devices.
    """
    source: OpenedIio = device.open()
    with closing(source.bus):
        put_down(source.listeners, device.say)
        sink = KernelSink(source, Journal.of(KERNEL, device.name))
        if sink.recover():
            device.say(f"an earlier write to {sink.where} was interrupted, and the old state is restored now")
        yield sink


class KernelSink(Sink):
    """Accelerometer of an open source of the Linux kernel; `journal` notes a write."""

    def __init__(self, source: OpenedIio, journal: Journal | None = None) -> None:
        self._source, self._journal = source, journal or Journal()
        self._decoder = IioDecoder("the kernel's driver")
        files = Port(source.bus, self._decoder.feed, tries=1)
        self._attributes = DeviceSetup(files, self._decoder, source.devices.accel, [ACCEL])
        name = f"61-mpucal-{source.devices.accel.replace(':', '-')}.rules"
        self._rule = None if source.rules is None else source.rules / name
        self.where = f"{source.devices.accel} ({self._attributes.read('name')})"

    def recover(self) -> bool:
        """Restore the state that an interrupted write noted; return True if there was one."""
        note = self._journal.interrupted()
        if note is not None:
            self._restore(note)
            self._journal.end()
        return note is not None

    def keep(self, folder: Path) -> tuple[Path, ...]:
        """Save calibbias and the rule to iio-state.json; see Sink."""
        return save_state(IIO_STATE, folder, FORMAT, self.where, self._read_state())

    def put_back(self, path: Path) -> str:
        """Restore the state from the file of an earlier `keep`; see Sink."""
        document = load_state(IIO_STATE, path, FORMAT, WORDS, RULE)
        if not (_are_words(document[WORDS]) and isinstance(document[RULE], str | None)):
            raise not_a_state(IIO_STATE, path, f"{WORDS} or {RULE} has another type")
        with self._restoring():
            self._restore(document)
        return f"{self.where} has the state of {path.name} again"

    def write(self, calibration: Calibration) -> Applied:
        """Write calibbias and udev's matrix, read both back, and verify calibbias in the samples; see Sink."""
        check_accepted(calibration)
        texts = self._decoder.texts(self._source.devices.accel)
        words, why = offset_words(calibration)
        if words is not None and not set(CALIBBIAS) <= self._attributes.names:
            words, why = None, "has no calibbias"
        accel = read_scale(ACCEL, self._source.devices.accel, texts, {})
        matrix = matrix_text(mount_matrix(texts, ACCEL) @ calibration.inverse * (accel.scale / accel.printed))
        with self._restoring():
            applied = np.zeros(3) if words is None else self._write_words(calibration, words)
            rule = self._write_matrix(texts["name"], matrix)
        subtracts = f"calibbias now subtracts ({mg_text(applied)}) mg, read back and verified in the samples"
        bias = subtracts if words else why
        return Applied(replace(calibration, applied_in_hardware=applied), (f"{self.where}: {bias}", rule))

    def _write_matrix(self, name: str, matrix: str) -> str:
        """Write a rule of udev for D; return a clause on the result."""
        if self._rule is None:
            return "there is no udev to take D"
        device = self._source.devices.accel
        match = f'SUBSYSTEM=="iio", KERNEL=="{device}", ATTR{{name}}=="{name}"'
        self._write_rule(f'# {self.where}, by mpucal\n{match}, ENV{{ACCEL_MOUNT_MATRIX}}="{matrix}"\n')
        return f"{self._rule} holds D as ACCEL_MOUNT_MATRIX, {_udev(device, matrix)}"

    def _write_words(self, calibration: Calibration, words: Words) -> Vector:
        """Write calibbias; return (3,) m/s^2 that it then subtracts.

        Raises
        ------
        ChipError : it does not read back as written, or the samples do not show it.
        """
        old = self._words()
        if old is None:
            raise ChipError(f"calibbias of {self.where} is missing", "check it in /sys/bus/iio/devices")
        before = self._rest()
        self._set_words(words)
        after = self._rest()
        remedy = "keep the board still and try again; if it was still, use only files: the driver uses wrong registers"
        check_shift(after - before, -subtraction(words, old, LSB_PER_G), remedy)
        reference: Any = calibration.sensor.accel_offsets
        return subtraction(words, reference, LSB_PER_G)

    def _set_words(self, words: Words) -> None:
        for name, word in zip(CALIBBIAS, words, strict=True):
            held = self._attributes.set(name, str(word))
            if held != str(word):
                raise ChipError(f"{name} of {self.where} reads back {held}, not {word}", "check the chip's wires")

    def _rest(self) -> Vector:
        """Return (3,) m/s^2, the mean of a second in which the board lay still.

        Raises
        ------
        ChipError : it never lay still. BusError : a channel cannot be read.
        """
        driver = IioDriver(self._source.bus, self._source.devices, Config(), trigger=POLLED)
        driver.start()
        try:
            for _ in range(PATIENCE):
                driver.forget()
                acc = measured(driver, 1.0).acc
                if len(acc) > 10 and is_untouched(acc):
                    return np.asarray(acc.mean(axis=0), np.float64)
        finally:
            driver.stop()
        raise ChipError("the board did not lie still", "put it on a firm surface, and write again")

    def _words(self) -> Words | None:
        if not set(CALIBBIAS) <= self._attributes.names:
            return None
        x, y, z = (int(self._attributes.read(name)) for name in CALIBBIAS)
        return x, y, z

    def _read_state(self) -> dict[str, Any]:
        there = self._rule is not None and self._rule.exists()
        return {WORDS: self._words(), RULE: self._rule.read_text(encoding="utf-8") if self._rule and there else None}

    def _write_rule(self, text: str | None) -> None:
        if self._rule is None:
            return
        try:
            if text is None:
                self._rule.unlink(missing_ok=True)
            else:
                write_atomically(self._rule, text.encode())
        except (OSError, OutputError) as error:
            raise ChipError(f"cannot write {self._rule} ({error})", "run it as root (sudo)") from error

    def _restore(self, held: Mapping[str, Any]) -> None:
        if held[WORDS] is not None:
            x, y, z = held[WORDS]
            self._set_words((x, y, z))
        if held[RULE] != self._read_state()[RULE]:
            self._write_rule(held[RULE])

    def _restoring(self) -> AbstractContextManager[None]:
        with nothing_written():
            held = self._read_state()
        return restore_on_failure(self._journal, held, lambda: self._restore(held), self.where)


def _are_words(held: Any) -> bool:
    """Return True for a result of `_words`: None or three integers."""
    return held is None or (isinstance(held, list) and [type(word) for word in held] == [int] * 3)


def _udev(device: str, matrix: str) -> str:
    """Have udev reload its rules; return a clause on whether it has the matrix."""
    later = "which udev applies when the device appears again"
    if shutil.which("udevadm") is None:
        return later
    path = f"/sys/bus/iio/devices/{device}"
    for words in (["control", "--reload"], ["trigger", "--action=change", "--settle", path]):
        subprocess.run(["udevadm", *words], capture_output=True, check=False)
    found = subprocess.run(["udevadm", "info", "-q", "property", path], capture_output=True, text=True, check=False)
    return "read back from udev" if f"ACCEL_MOUNT_MATRIX={matrix}" in found.stdout else later
