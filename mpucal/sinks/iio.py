"""A driver of the kernel as a sink: b_a in calibbias of an MPU-6050, D as udev's ACCEL_MOUNT_MATRIX.

inv_mpu6050's calibbias are the words of the accelerometer's offset registers, 2048 to 1 g; of an MPU-6500 it writes y
and z elsewhere, so that there they are left alone. iio-sensor-proxy multiplies what the channels show by
ACCEL_MOUNT_MATRIX, in place of the device tree's matrix M: it becomes M inv(D).
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..chip.access import Files
from ..chip.config import Config
from ..chip.offsets import Words, word_difference
from ..data import STANDARD_GRAVITY_MPS2, Vector
from ..disk.whole import write_atomically
from ..errors import ChipError, OutputError, SourceError, WriteBackError
from ..export.linux_iio import LSB_PER_G, matrix_text, offset_words
from ..iio.attributes import ACCEL, AXES, mount_matrix
from ..iio.decode import IioDecoder
from ..iio.driver import IioDriver
from ..iio.setup import POLLED, Attributes
from ..rests.stillness import let_go
from ..result.calibration import REFUSED, Calibration
from ..result.journal import Journal
from ..session.lay_flat import put_down
from ..sources.iio import OpenedIio
from .kept import keep, kept, not_kept
from .kind import Device
from .sink import Applied
from .table import IIO_STATE, KERNEL

FORMAT, WORDS, RULE = "mpucal.iio_state", "calibbias", "rule"
REST_NS, TRIES, FEWEST = 1_000_000_000, 20, 10
# a measured step, as of the chip's sink
SHIFT_G, SHIFT_SHARE = 0.006, 0.1
CALIBBIAS = [f"{ACCEL}_{axis}_calibbias" for axis in AXES]


@contextmanager
def open_kernel(device: Device) -> Iterator[KernelSink]:
    """The devices that --iio names, once their person was asked to put the board down.

    Raises
    ------
    BusError : there are none such.
    """
    source: OpenedIio = device.open()
    with closing(source.bus):
        put_down(source.listeners, device.say)
        sink = KernelSink(source, Journal.of(KERNEL, device.name))
        if sink.recover():
            device.say(f"a write to {sink.where} was cut off, and what was there before is back")
        yield sink


class KernelSink:
    """The accelerometer of an open source of the kernel; `journal` notes a write."""

    def __init__(self, source: OpenedIio, journal: Journal | None = None) -> None:
        self._source, self._journal = source, journal or Journal()
        self._files: Files = source.bus  # type: ignore[assignment]
        self._decoder = IioDecoder("the kernel's driver")
        self._attributes = Attributes(self._files, self._decoder, source.devices.accel)
        self._attributes.look([ACCEL])
        name = f"61-mpucal-{source.devices.accel.replace(':', '-')}.rules"
        self._rule = None if source.rules is None else source.rules / name
        self.where = f"{source.devices.accel} ({self._attributes.read('name')})"

    def recover(self) -> bool:
        """Put back what an earlier write that was cut off noted; whether there was one."""
        left = self._journal.interrupted()
        if left is not None:
            self._restore(left)
            self._journal.end()
        return left is not None

    def keep(self, folder: Path) -> tuple[Path, ...]:
        """Save calibbias and the rule to iio-state.json; see Sink."""
        return keep(IIO_STATE, folder, FORMAT, self.where, self._held())

    def put_back(self, path: Path) -> str:
        """Write what an earlier `keep` saved, and say so in a sentence.

        Raises
        ------
        RecordingError : `path` is no such file. WriteBackError : see Sink.
        """
        document = kept(IIO_STATE, path, FORMAT, WORDS, RULE)
        if not (_are_words(document[WORDS]) and isinstance(document[RULE], str | None)):
            raise not_kept(IIO_STATE, path, f"{WORDS} or {RULE} is of another kind")
        with self._old_or_new():
            self._restore(document)
        return f"{self.where} holds again what {path.name} says"

    def write(self, calibration: Calibration) -> Applied:
        """Write calibbias and udev's matrix, read both back, and see calibbias in the samples; see Sink."""
        known = np.isfinite(calibration.D).all() and np.isfinite(calibration.b_a).all()
        if calibration.quality.get("verdict") == REFUSED or not known:
            raise WriteBackError("nothing was written: the calibration was refused", "repeat the session as it says")
        texts = self._decoder.texts(self._source.devices.accel)
        words, why = offset_words(calibration)
        if words is not None and not set(CALIBBIAS) <= self._attributes.names:
            words, why = None, "has no calibbias"
        matrix = matrix_text(mount_matrix(texts, ACCEL) @ calibration.inverse)
        with self._old_or_new():
            applied = np.zeros(3) if words is None else self._write_words(calibration, words)
            said = self._write_matrix(texts["name"], matrix)
        mg = ", ".join(f"{1000 * value:+.0f}" for value in applied / STANDARD_GRAVITY_MPS2)
        bias = f"calibbias now subtracts ({mg}) mg, read back and seen in the samples" if words else why
        return Applied(replace(calibration, applied_in_hardware=applied), f"{self.where}: {bias}; {said}")

    def _write_matrix(self, name: str, matrix: str) -> str:
        """A rule of udev, and what became of it in words."""
        if self._rule is None:
            return "it has no udev that takes D"
        device = self._source.devices.accel
        match = f'SUBSYSTEM=="iio", KERNEL=="{device}", ATTR{{name}}=="{name}"'
        self._write_rule(f'# {self.where}, by mpucal\n{match}, ENV{{ACCEL_MOUNT_MATRIX}}="{matrix}"\n')
        return f"{self._rule} holds D as ACCEL_MOUNT_MATRIX, {_udev(device, matrix)}"

    def _write_words(self, calibration: Calibration, words: Words) -> Vector:
        """(3,) m/s^2 that calibbias then subtracts.

        Raises
        ------
        ChipError : it is read back other than written, or not seen in the samples.
        """
        old = self._words()
        if old is None:
            raise ChipError(f"calibbias of {self.where} is no number", "look at it in /sys/bus/iio/devices")
        before = self._rest()
        self._set_words(words)
        after = self._rest()
        expected = np.array(word_difference(words, old)) / LSB_PER_G * STANDARD_GRAVITY_MPS2
        limit = SHIFT_G * STANDARD_GRAVITY_MPS2 + SHIFT_SHARE * np.abs(expected)
        if (np.abs(after - before - expected) > limit).any():
            moved, wanted = (", ".join(f"{value:+.2f}" for value in values) for values in (after - before, expected))
            raise ChipError(
                f"the samples moved by ({moved}) m/s² where calibbias should have moved them by ({wanted})",
                "leave the board still meanwhile; if it was, this driver writes other registers: keep to the files",
            )
        reference: Any = calibration.sensor.accel_offsets
        return -np.array(word_difference(words, reference)) / LSB_PER_G * STANDARD_GRAVITY_MPS2

    def _set_words(self, words: Words) -> None:
        for name, word in zip(CALIBBIAS, words, strict=True):
            held = self._attributes.set(name, str(word))
            if held != str(word):
                raise ChipError(f"{name} of {self.where} reads back {held}, not {word}", "check the chip's wires")

    def _rest(self) -> Vector:
        """(3,) m/s^2, the mean of a second in which the board lay still.

        Raises
        ------
        ChipError : it never did. BusError : a channel cannot be read.
        """
        driver = IioDriver(self._files, self._source.devices, Config(), trigger=POLLED)
        driver.start()
        try:
            for _ in range(TRIES):
                driver.forget()
                end_ns = driver.now_ns() + REST_NS
                while driver.now_ns() < end_ns:
                    driver.poll()
                acc = driver.recording().acc
                if len(acc) > FEWEST and let_go(acc):
                    return np.asarray(acc.mean(axis=0), np.float64)
        finally:
            driver.stop()
        raise ChipError("the board did not lie still", "put it on a firm surface, and write again")

    def _words(self) -> Words | None:
        if not set(CALIBBIAS) <= self._attributes.names:
            return None
        x, y, z = (int(self._attributes.read(name)) for name in CALIBBIAS)
        return x, y, z

    def _held(self) -> dict[str, Any]:
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
        if held[RULE] != self._held()[RULE]:
            self._write_rule(held[RULE])

    @contextmanager
    def _old_or_new(self) -> Iterator[None]:
        """What fails within leaves all as it was."""
        try:
            held = self._held()
        except SourceError as error:
            raise WriteBackError(f"nothing was written: {error.what}", error.remedy) from error
        self._journal.begin(held)
        try:
            yield
        except BaseException as error:
            try:
                self._restore(held)
            except SourceError as worse:
                raise WriteBackError(f"the write failed, and then {worse.what}", worse.remedy) from error
            self._journal.end()
            if isinstance(error, SourceError):
                raise WriteBackError(f"{error.what}; {self.where} is as before", error.remedy) from error
            raise
        self._journal.end()


def _are_words(held: Any) -> bool:
    """Whether `_words` can have given it: None, or three integers."""
    return held is None or (isinstance(held, list) and [type(word) for word in held] == [int] * 3)


def _udev(device: str, matrix: str) -> str:
    """Have udev read its rules, and say whether it took the matrix."""
    later = "which udev takes when the device appears next"
    if shutil.which("udevadm") is None:
        return later
    path = f"/sys/bus/iio/devices/{device}"
    for words in (["control", "--reload"], ["trigger", "--action=change", "--settle", path]):
        subprocess.run(["udevadm", *words], capture_output=True, check=False)
    found = subprocess.run(["udevadm", "info", "-q", "property", path], capture_output=True, text=True, check=False)
    return "read back from udev" if f"ACCEL_MOUNT_MATRIX={matrix}" in found.stdout else later
