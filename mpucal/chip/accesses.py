"""Many register accesses at once, as columns: what a capture holds of half a second and more."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from operator import attrgetter
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from .access import Failure, Transaction
from .registers import ACCEL_WORDS, FIFO_R_W, FRAME_WORDS

Whole = NDArray[np.int64]

# registers have one byte
FILE = 256


@dataclass(frozen=True)
class Accesses:
    """Accesses in the order in which they happened, (n,) each.

    Attributes
    ----------
    write, heard, framed : bool; whether it was a write, has a `host_ns`, and has its bytes in `frames`.
    register, count, moved : address, bytes asked for (given), bytes moved. t_ns, host_ns : see Transaction.
    data : (bytes,) uint8 of all that are not framed. frames : (rows, words) int16 of those that are.
    failures : of those that failed, by number. files : names; of Files, `register` is FILE + the place in them.
    """

    write: NDArray[np.bool_]
    heard: NDArray[np.bool_]
    framed: NDArray[np.bool_]
    register: Whole
    count: Whole
    moved: Whole
    t_ns: Whole
    host_ns: Whole
    data: NDArray[np.uint8]
    frames: NDArray[np.int16]
    failures: Mapping[int, Failure] = field(default_factory=dict)
    files: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """ValueError where the columns do not fit each other."""
        columns = (self.heard, self.framed, self.register, self.count, self.moved, self.t_ns, self.host_ns)
        if any(len(column) != len(self.write) for column in columns):
            raise ValueError("columns of different lengths")
        framed = self.moved[self.framed]
        fits = (
            bool((self.moved >= 0).all())
            and int(self.moved[~self.framed].sum()) == len(self.data)
            and int(framed.sum()) == 2 * self.frames.size
            and not (framed % max(2 * self.frames.shape[1], 1)).any()
            and all(0 <= number < len(self) for number in self.failures)
            and bool(((self.register >= 0) & (self.register < FILE + len(self.files))).all())
        )
        if not fits:
            raise ValueError("columns that do not fit each other")

    def __len__(self) -> int:
        return len(self.write)

    def __iter__(self) -> Iterator[Transaction]:
        return self.part(0, len(self))

    def part(self, first: int, last: int) -> Iterator[Transaction]:
        """Numbers first..last-1, one after the other."""
        (data, frames), size = self._bytes, 2 * self.frames.shape[1]
        shown = (self.write, self.heard, self.framed, self.register, self.count, self.t_ns, self.host_ns)
        rows = zip(*(column[first:last].tolist() for column in shown), strict=True)
        places = zip(self.begin[first:last].tolist(), self.end[first:last].tolist(), strict=True)
        for i, (row, (begin, end)) in enumerate(zip(rows, places, strict=True), first):
            write, heard, framed, register, count, t_ns, host_ns = row
            moved = frames[begin * size : end * size] if framed else data[begin:end]
            op: Literal["read", "write"] = "write" if write else "read"
            place = register if register < FILE else self.files[register - FILE]
            yield Transaction(op, place, count, moved, t_ns, self.failures.get(i), host_ns if heard else None)

    @cached_property
    def _bytes(self) -> tuple[bytes, bytes]:
        """`data`, and `frames` as the chip sends them."""
        return self.data.tobytes(), self.frames.astype(">i2").tobytes()

    @cached_property
    def end(self) -> Whole:
        """(n,) where the bytes of each end: in `data`, or the row in `frames`."""
        rows = np.where(self.framed, self.moved // max(2 * self.frames.shape[1], 1), 0)
        return np.where(self.framed, np.cumsum(rows), np.cumsum(np.where(self.framed, 0, self.moved)))

    @cached_property
    def begin(self) -> Whole:
        """(n,) where they begin."""
        return self.end - np.where(self.framed, self.moved // max(2 * self.frames.shape[1], 1), self.moved)

    def can_join(self, other: Accesses) -> bool:
        """True where both number registers and have frames of one length: then they can be joined."""
        plain = not (self.failures or other.failures or self.files or other.files)
        return plain and self.frames.shape[1] == other.frames.shape[1]

    @classmethod
    def joined(cls, parts: Sequence[Accesses]) -> Accesses:
        """All parts, one at least and all alike, one after the other."""
        if len(parts) == 1:
            return parts[0]
        columns: Any = map(np.concatenate, zip(*map(_columns, parts), strict=True))
        return cls(*columns)

    @classmethod
    def from_transactions(cls, transactions: Sequence[Transaction]) -> Accesses:
        """The same accesses; what was read from the FIFO is framed where all of it is whole frames."""
        moved = np.array([len(each.data) for each in transactions], np.int64)
        write, fifo = (
            np.array(column, bool)
            for column in (
                [each.op == "write" for each in transactions],
                [each.register == FIFO_R_W for each in transactions],
            )
        )
        framed = fifo & ~write & (moved > 0)
        words = next((words for words in (FRAME_WORDS, ACCEL_WORDS) if not (moved[framed] % (2 * words)).any()), 0)
        framed &= words > 0
        files = tuple(dict.fromkeys(each.register for each in transactions if isinstance(each.register, str)))
        numbers = {name: FILE + i for i, name in enumerate(files)}
        shown = [each.host_ns for each in transactions]
        return cls(
            write,
            np.array([ns is not None for ns in shown], bool),
            framed,
            np.array([numbers.get(each.register, each.register) for each in transactions], np.int64),
            np.array([each.count for each in transactions], np.int64),
            moved,
            np.array([each.t_ns for each in transactions], np.int64),
            np.array([ns or 0 for ns in shown], np.int64),
            np.frombuffer(_joined(transactions, ~framed), np.uint8),
            np.frombuffer(_joined(transactions, framed), ">i2").astype(np.int16).reshape(-1, max(words, 1)),
            {i: each.error for i, each in enumerate(transactions) if each.error is not None},
            files,
        )


_columns = attrgetter(*(f.name for f in fields(Accesses) if f.name not in ("failures", "files")))


def _joined(transactions: Sequence[Transaction], chosen: NDArray[np.bool_]) -> bytes:
    return b"".join(each.data for each, is_chosen in zip(transactions, chosen, strict=True) if is_chosen)
