"""Model of a disk after a power cut: data that was not synced is lost, in part or whole, and in any order.

The calls come from the log of syscalls.c. Data written to a file is safe once the file is synced. A name that is
created or removed is safe once its folder is synced.
"""

import os
import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import NamedTuple


class Call(NamedTuple):
    """System call in the log.

    Attributes
    ----------
    op : o(pen), i(n: read), w(rite), s(ync), c(lose), r(ename), u(nlink), m(kdir), p(ermissions), l(ook: stat, list),
        a(s memory: mmap); d: a device's state, which is no call. done : it did not fail. at : of open, the flags.
    """

    op: str
    done: bool
    at: int
    path: str
    other: str
    data: bytes


def logged(log: bytes, root: str) -> Iterator[Call]:
    """Yield the calls of a log, with paths relative to `root`."""
    while log:
        head, _, log = log.partition(b"\n")
        op, done, at, size, *paths = head.decode().split("\t")
        data, log = log[: int(size)], log[int(size) :]
        path, other = (os.path.relpath(os.path.join(root, path), root) if path else "" for path in paths)  # noqa: PTH118
        yield Call(op, done == "1", int(at), path, other, data)


@dataclass
class Inode:
    """File or folder: its content on the disk, and the writes since the last sync."""

    kept: bytes = b""
    since: list[tuple[int, bytes]] = field(default_factory=list)
    folder: bool = False

    def after(self, writes: Sequence[tuple[int, bytes]]) -> bytes:
        """Return the content after only these writes."""
        data = bytearray(self.kept)
        for at, part in writes:
            data.extend(bytes(max(0, at + len(part) - len(data))))
            data[at : at + len(part)] = part
        return bytes(data)


class Disk:
    """Disk with files by name; at first `content`.

    Attributes
    ----------
    synced : content of each file at its last sync. placed : contents that were renamed to a name.
    """

    def __init__(self, content: Mapping[str, bytes]) -> None:
        self._names = {name: Inode(data) for name, data in content.items()}
        self._now = dict(self._names)
        # names created (or removed: None) since their folder was synced
        self._since: list[tuple[str, Inode | None]] = []
        self.synced: dict[str, bytes] = {}
        self.placed: dict[str, list[bytes]] = {}

    def call(self, call: Call) -> None:
        """Apply a call."""
        op, path = call.op, call.path
        inode = self._now.get(path)
        if not call.done:
            return
        if op == "o" and call.at & os.O_CREAT and (inode is None or call.at & (os.O_TRUNC | os.O_EXCL)):
            self._set(path, Inode())
        elif op == "m":
            self._set(path, Inode(folder=True))
        elif op == "w" and inode is not None:
            inode.since.append((call.at, call.data))
        elif op == "s" and inode is not None and not inode.folder:
            inode.kept, inode.since = inode.after(inode.since), []
            self.synced[path] = inode.kept
        elif op == "s":
            for name, entry in (each for each in self._since if str(PurePath(each[0]).parent) == path):
                self._settle(self._names, name, entry)
            self._since = [each for each in self._since if str(PurePath(each[0]).parent) != path]
        elif op == "r" and inode is not None:
            self._set(path, None)
            self._set(call.other, inode)
            self.placed.setdefault(call.other, []).append(inode.after(inode.since))
        elif op == "u":
            self._set(path, None)

    def cut(self, rng: random.Random, share: float) -> dict[str, bytes]:
        """Return the files after a power cut, when a `share` of the unsynced data reached the disk, in any order."""
        names = dict(self._names)
        for name, inode in rng.sample(self._since, len(self._since)):
            if rng.random() < share:
                self._settle(names, name, inode)
        folders = {name for name, inode in self._now.items() if inode.folder} - names.keys()
        return {
            name: inode.after([write for write in inode.since if rng.random() < share])
            for name, inode in names.items()
            if not inode.folder and folders.isdisjoint(map(str, PurePath(name).parents))
        }

    def _set(self, name: str, inode: Inode | None) -> None:
        self._settle(self._now, name, inode)
        self._since.append((name, inode))

    @staticmethod
    def _settle(names: dict[str, Inode], name: str, inode: Inode | None) -> None:
        if inode is None:
            names.pop(name, None)
        else:
            names[name] = inode
