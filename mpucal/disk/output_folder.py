"""A folder for results, in which one process writes at a time."""

from __future__ import annotations

import os
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Self

from ..errors import OutputError
from .atomic import make_folders, sync_folder
from .location import current_path


class OutputFolder:
    """A folder, made where it is missing, that no other process of mpucal writes to until it is closed.

    Where neither the system nor the disk knows locks, nobody is kept away.

    Parameters
    ----------
    path : of it. new : it is not there yet, and has the first number behind its name that is free.

    Raises
    ------
    OutputError : it cannot be made, or another process writes to it.
    """

    def __init__(self, path: Path, new: bool = False) -> None:
        self._path = _made(str(path)) if new else path
        try:
            make_folders(self._path)
        except OSError as error:
            raise _not_made(path, error) from error
        self._handle = _locked(self._path)

    @property
    def path(self) -> Path:
        """Where it is now.

        Raises
        ------
        OutputError : it was removed, or another one is in its place.
        """
        if self._handle is not None:
            found = current_path(self._handle, self._path)
            if found is None:
                raise OutputError(
                    f"the folder {self._path} was removed or replaced by another program",
                    "start again, with another -o",
                )
            self._path = found
        return self._path

    def rename(self, name: str) -> None:
        """Rename it, to `name` or with the first number behind it that is free; where that fails, it stays."""
        with suppress(OSError, OutputError):
            free = _made(name)
            try:
                self._path = self.path.rename(free)
            except OSError:
                free.rmdir()
            sync_folder(free.parent)

    def close(self) -> None:
        """Let others write to it."""
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def free_name(path: Path) -> Path:
    """`path`, or with the first number behind it that nothing has."""
    return next(name for name in _numbered(str(path)) if not os.path.lexists(name))


def _numbered(name: str) -> map[Path]:
    return map(Path, (name if number == 1 else f"{name}-{number}" for number in count(1)))


def _made(name: str) -> Path:
    for path in _numbered(name):
        try:
            path.mkdir()
        except FileExistsError:
            continue
        except OSError as error:
            raise _not_made(path, error) from error
        sync_folder(path.parent)
        return path
    raise AssertionError(name)


def _not_made(path: Path, error: OSError) -> OutputError:
    return OutputError(f"cannot make the folder {path} ({error.strerror})", "choose another one with -o")


def _locked(path: Path) -> int | None:
    """A handle of the folder, with its lock as far as there are any."""
    try:
        import fcntl  # noqa: PLC0415 - not on Windows, which opens no folders either

        handle = os.open(path, os.O_RDONLY)
    except (ImportError, OSError):
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        holder = _holder(handle)
        os.close(handle)
        raise OutputError(
            f"another mpucal{holder} writes to {path}", "wait for it, or choose another folder with -o"
        ) from error
    except OSError:
        # a disk of another computer that knows none
        pass
    return handle


def _holder(handle: int) -> str:
    """The process that has the lock, by the kernel's list of them, as proc(5) has it; empty where that is not told."""
    inode = str(os.fstat(handle).st_ino)
    with suppress(OSError, IndexError):
        for line in Path("/proc/locks").read_text(encoding="ascii").splitlines():
            _, kind, _, _, process, where, *_ = line.split()
            if kind == "FLOCK" and where.rpartition(":")[2] == inode:
                return f" (process {process})"
    return ""
