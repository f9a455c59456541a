"""Frames of an IIO buffer, with the storage of each channel.

Source: Linux Documentation/ABI/testing/sysfs-bus-iio (scan_elements: index, type); drivers/iio/industrialio-buffer.c,
iio_compute_scan_bytes: each element is aligned to its own size, a frame to its largest.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..errors import ChipError

TYPE = re.compile(r"(be|le):([su])(\d+)/(8|16|32|64)(?:X(\d+))?>>(\d+)")


@dataclass(frozen=True)
class ScanElement:
    """Channel of a frame.

    Attributes
    ----------
    name : such as in_accel_x. index : its order among the channels. order : byte order < or >, as in NumPy.
    signed, bits, shift : the value has `bits` bits, `shift` bits above the lowest stored one.
    stored_bytes : of one value. repeat : number of consecutive values.
    """

    name: str
    index: int
    order: str
    signed: bool
    bits: int
    stored_bytes: int
    shift: int
    repeat: int = 1

    @classmethod
    def parse(cls, name: str, index: str, text: str) -> Self:
        """Parse the attributes `index` and `type`, such as le:s16/16>>0.

        Raises
        ------
        ChipError : another form of text.
        """
        found = TYPE.fullmatch(text.strip())
        if found is not None and index.strip().isdecimal():
            order, sign = found.group(1, 2)
            bits, stored, repeat, shift = (int(digits or 1) for digits in found.group(3, 4, 5, 6))
            if 0 < bits <= stored - shift and repeat > 0:
                return cls(
                    name, int(index), "<" if order == "le" else ">", sign == "s", bits, stored // 8, shift, repeat
                )
        raise ChipError(
            f"the driver describes the storage of {name} as {text.strip()!r}, which is unknown",
            "report it with the kernel's version",
        )

    @property
    def bytes(self) -> int:
        """Size in the frame; its position is a multiple of this."""
        return self.stored_bytes * self.repeat

    def values(self, stored: NDArray[np.unsignedinteger]) -> NDArray[np.int64]:
        """Decode the stored values (n,); the first of several consecutive ones."""
        one = stored.astype(np.uint64) if self.repeat == 1 else stored[:, 0].astype(np.uint64)
        held = (one >> np.uint64(self.shift)) & np.uint64((1 << self.bits) - 1)
        if not self.signed:
            return held.astype(np.int64)
        up = np.uint64(64 - self.bits)
        return np.asarray((held << up).view(np.int64) >> np.int64(up))


class FrameLayout:
    """Positions of the elements in a frame."""

    def __init__(self, elements: Iterable[ScanElement]) -> None:
        self.elements = sorted(elements, key=lambda element: element.index)
        at, places = 0, []
        for element in self.elements:
            at += -at % element.bytes
            places.append(at)
            at += element.bytes
        self.frame_bytes = at + -at % max(element.bytes for element in self.elements)
        self._dtype = np.dtype(
            {
                "names": [element.name for element in self.elements],
                "formats": [
                    (f"{e.order}u{e.stored_bytes}", (e.repeat,)) if e.repeat > 1 else f"{e.order}u{e.stored_bytes}"
                    for e in self.elements
                ],
                "offsets": places,
                "itemsize": self.frame_bytes,
            }
        )

    def columns(self, data: bytes) -> Mapping[str, NDArray[np.int64]]:
        """Decode n frames to counts (n,) of each channel.

        Raises
        ------
        ChipError : the bytes are not a whole number of frames.
        """
        if len(data) % self.frame_bytes:
            raise ChipError(
                f"the kernel's buffer returned {len(data)} bytes, but a frame has {self.frame_bytes}",
                "report it with the kernel's version",
            )
        frames = np.frombuffer(data, self._dtype)
        return {element.name: element.values(frames[element.name]) for element in self.elements}

    def packed(self, columns: Mapping[str, NDArray[np.int64]]) -> bytes:
        """Encode whole counts (n,) of each channel to frames; channels must not be shifted or repeated."""
        frames = np.zeros(len(next(iter(columns.values()))), self._dtype)
        for element in self.elements:
            frames[element.name] = np.asarray(columns[element.name]).astype(np.int64).astype(f"u{element.stored_bytes}")
        return frames.tobytes()
