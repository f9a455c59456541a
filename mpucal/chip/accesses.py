"""Register accesses as columns: the form in which a capture stores half a second or more of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from itertools import compress
from operator import attrgetter
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..arguments import Mask, Whole
from .access import Failure, Transaction
from .registers import FIFO_R_W, FRAME_BYTES, FRAME_WORDS

# Register addresses are one byte: larger numbers stand for files.
FIRST_FILE_NUMBER = 256


@dataclass(frozen=True)
class Accesses:
    """Accesses in the order in which they happened, as columns (n,).

    Attributes
    ----------
    write, has_host_ns, framed : True for a write, for an access with a `host_ns`, for one whose bytes are in `frames`.
    register, count, moved : address, bytes requested (given), bytes moved. t_ns, host_ns : see Transaction.
    data : (bytes,) uint8 of the accesses that are not framed. frames : (rows, words) int16 of the framed ones.
    failures : errors by the number of the access.
    files : names of files; `register` is FIRST_FILE_NUMBER + the index of the name.
    """

    write: Mask
    has_host_ns: Mask
    framed: Mask
    register: Whole
    count: Whole
    moved: Whole
    t_ns: Whole
    host_ns: Whole
    data: NDArray[np.uint8]
    frames: NDArray[np.int16]
    failures: Mapping[int, Failure] = field(default_factory=dict)
    files: tuple[str, ...] = ()

    def check(self) -> None:
        """Raise ValueError if the columns, which were read from a file, do not fit each other."""
        columns = (self.has_host_ns, self.framed, self.register, self.count, self.moved, self.t_ns, self.host_ns)
        if any(len(column) != len(self.write) for column in columns):
            raise ValueError("columns of different lengths")
        framed = self.moved[self.framed]
        fits = (
            bool((self.moved >= 0).all())
            and int(self.moved[~self.framed].sum()) == len(self.data)
            and int(framed.sum()) == 2 * self.frames.size
            and not (framed % max(2 * self.frames.shape[1], 1)).any()
            and all(0 <= number < len(self) for number in self.failures)
            and bool(((self.register >= 0) & (self.register < FIRST_FILE_NUMBER + len(self.files))).all())
        )
        if not fits:
            raise ValueError("columns that do not fit each other")

    def __len__(self) -> int:
        return len(self.write)

    def __iter__(self) -> Iterator[Transaction]:
        return self.part(0, len(self))

    def part(self, first: int, last: int) -> Iterator[Transaction]:
        """Yield the accesses first..last-1 one by one."""
        (data, frames), size = self._bytes, 2 * self.frames.shape[1]
        shown = (self.write, self.has_host_ns, self.framed, self.register, self.count, self.t_ns, self.host_ns)
        rows = zip(*(column[first:last].tolist() for column in shown), strict=True)
        places = zip(self.begin[first:last].tolist(), self.end[first:last].tolist(), strict=True)
        for i, (row, (begin, end)) in enumerate(zip(rows, places, strict=True), first):
            write, has_host_ns, framed, register, count, t_ns, host_ns = row
            moved = frames[begin * size : end * size] if framed else data[begin:end]
            op: Literal["read", "write"] = "write" if write else "read"
            place = register if register < FIRST_FILE_NUMBER else self.files[register - FIRST_FILE_NUMBER]
            yield Transaction(op, place, count, moved, t_ns, self.failures.get(i), host_ns if has_host_ns else None)

    @cached_property
    def _bytes(self) -> tuple[bytes, bytes]:
        """Bytes of `data`, and of `frames` in the chip's byte order."""
        return self.data.tobytes(), self.frames.astype(">i2").tobytes()

    @cached_property
    def _sizes(self) -> Whole:
        """(n,) bytes in `data`, or rows in `frames`, of each access."""
        return np.where(self.framed, self.moved // max(2 * self.frames.shape[1], 1), self.moved)

    @cached_property
    def end(self) -> Whole:
        """(n,) end of each access's bytes in `data`, or of its rows in `frames`."""
        rows, others = (np.cumsum(np.where(chosen, self._sizes, 0)) for chosen in (self.framed, ~self.framed))
        return np.where(self.framed, rows, others)

    @cached_property
    def begin(self) -> Whole:
        """(n,) begin of each access's bytes in `data`, or of its rows in `frames`."""
        return self.end - self._sizes

    def can_join(self, other: Accesses) -> bool:
        """Return True if neither has failures or files, and both have frames of the same length."""
        plain = not (self.failures or other.failures or self.files or other.files)
        return plain and self.frames.shape[1] == other.frames.shape[1]

    @classmethod
    def joined(cls, parts: Sequence[Accesses]) -> Accesses:
        """Concatenate one or more parts that `can_join` each other."""
        if len(parts) == 1:
            return parts[0]
        columns: Any = map(np.concatenate, zip(*map(_columns, parts), strict=True))
        return cls(*columns)

    @classmethod
    def from_transactions(cls, transactions: Sequence[Transaction]) -> Accesses:
        """Convert single accesses; reads of the FIFO are framed if all of them are whole frames."""
        ops, registers, counts, data, t_ns, errors, host_ns = zip(
            *(vars(each).values() for each in transactions), strict=True
        )
        moved = np.array([*map(len, data)], np.int64)
        write = np.array([op == "write" for op in ops], bool)
        fifo = np.array([register == FIFO_R_W for register in registers], bool)
        framed = fifo & ~write & (moved > 0)
        framed &= not (moved[framed] % FRAME_BYTES).any()
        files = tuple(dict.fromkeys(register for register in registers if isinstance(register, str)))
        numbers = {name: FIRST_FILE_NUMBER + i for i, name in enumerate(files)}
        return cls(
            write,
            np.array([ns is not None for ns in host_ns], bool),
            framed,
            np.array([numbers.get(register, register) for register in registers], np.int64),
            np.array(counts, np.int64),
            moved,
            np.array(t_ns, np.int64),
            np.array([ns or 0 for ns in host_ns], np.int64),
            np.frombuffer(b"".join(compress(data, ~framed)), np.uint8),
            np.frombuffer(b"".join(compress(data, framed)), ">i2").astype(np.int16).reshape(-1, FRAME_WORDS),
            {i: error for i, error in enumerate(errors) if error is not None},
            files,
        )


_columns = attrgetter(*(f.name for f in fields(Accesses) if f.name not in ("failures", "files")))
