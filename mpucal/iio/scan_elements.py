"""Frames of an IIO buffer, with the storage of each channel, and streams interpolated to common times.

Source: Linux Documentation/ABI/testing/sysfs-bus-iio (scan_elements: index, type); drivers/iio/industrialio-buffer.c,
iio_compute_scan_bytes: each element is aligned to its own size, a frame to its largest.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..data import Vector
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


Times = NDArray[np.int64]


class StreamAligner:
    """Aligner that takes each stream's samples as they come, and returns the complete rows.

    The rows depend on the samples alone, not on how they were grouped.

    Parameters
    ----------
    widths : number of columns of each stream.
    """

    def __init__(self, widths: Sequence[int]) -> None:
        self._t = [np.zeros(0, np.int64) for _ in widths]
        self._values = [np.zeros((0, width)) for width in widths]
        self._last = [np.iinfo(np.int64).min] * len(widths)

    def add(self, stream: int, t_ns: Times, values: Vector) -> None:
        """Add samples (n, width) of a stream at `t_ns` (n,); one that is not later than the earlier ones is dropped."""
        latest = np.maximum.accumulate(np.concatenate(([self._last[stream]], t_ns)))
        later = t_ns > latest[:-1]
        self._last[stream] = int(latest[-1])
        self._t[stream] = np.concatenate((self._t[stream], t_ns[later]))
        self._values[stream] = np.concatenate((self._values[stream], values[later]))

    def take(self) -> tuple[Times, Vector]:
        """Return the new complete rows: times (n,) of the first stream, and all streams' columns at these times."""
        t_ns, values = self._t[0], self._values[0]
        if not all(map(len, self._t)):
            return t_ns[:0], np.zeros((0, sum(value.shape[1] for value in self._values)))
        due = int(np.searchsorted(t_ns, min(t[-1] for t in self._t), "right"))
        first = int(np.searchsorted(t_ns, max(t[0] for t in self._t)))
        asked = t_ns[first:due]
        parts = [values[first:due]]
        for i, (t, held) in enumerate(zip(self._t[1:], self._values[1:], strict=True), 1):
            parts.append(_interpolate(asked, t, held))
            if due:
                # The last sample at or before the returned times is needed for the next ones.
                kept = max(int(np.searchsorted(t, t_ns[due - 1], "right")) - 1, 0)
                self._t[i], self._values[i] = t[kept:], held[kept:]
        self._t[0], self._values[0] = t_ns[max(due, first) :], values[max(due, first) :]
        return asked, np.concatenate(parts, axis=1)


def _interpolate(asked: Times, t: Times, values: Vector) -> Vector:
    """Interpolate `values` (m, width) at the times `t` (m,) to the times `asked` (n,) between them."""
    if len(asked) == 0:
        return np.zeros((0, values.shape[1]))
    x, known = (asked - t[0]).astype(np.float64), (t - t[0]).astype(np.float64)
    return np.stack([np.interp(x, known, column) for column in values.T], axis=1)
