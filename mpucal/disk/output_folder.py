"""Folder for results, in which only one process writes at a time."""

from __future__ import annotations

import os
import shlex
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Self

from ..errors import OutputError
from .atomic import current_path, make_folders, sync_folder


class OutputFolder:
    """Folder that is created if needed, and locked against other processes of mpucal until it is closed.

    There is no lock if the system or the disk does not support locks. A folder that was created for nothing, because it
    is empty when it is closed, is removed.

    Parameters
    ----------
    path : of the folder. new : create a new folder, with the first free number behind its name.
    only : no other folder will do, so that no error suggests one.

    Raises
    ------
    OutputError : the folder cannot be created, or another process writes to it.
    """

    def __init__(self, path: Path, new: bool = False, only: bool = False) -> None:
        self._path = _create(str(path)) if new else path
        self._created = new or not path.exists()
        try:
            make_folders(self._path)
        except OSError as error:
            raise _creation_error(path, error) from error
        self._handle = _lock(self._path, only)

    @property
    def path(self) -> Path:
        """Present path of the folder.

        Raises
        ------
        OutputError : the folder was removed or replaced.
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
        """Rename the folder to `name`, with the first free number behind it; keep the old name if that fails."""
        with suppress(OSError, OutputError):
            free = _create(name)
            try:
                self._path = self.path.rename(free)
            except OSError:
                free.rmdir()
            sync_folder(free.parent)

    def close(self) -> None:
        """Release the lock."""
        if self._created:
            with suppress(OSError, OutputError):
                self.path.rmdir()
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def free_name(path: Path, suffix: str = "") -> Path:
    """Return `path` with `suffix`, with the first free number between them if that exists."""
    if path.name in ("", ".."):  # the present folder, or the one above it
        path = path.resolve()
    return next(name for name in _numbered(str(path), suffix) if not os.path.lexists(name))


def _numbered(name: str, suffix: str = "") -> map[Path]:
    return map(Path, (f"{name}{'' if number == 1 else f'-{number}'}{suffix}" for number in count(1)))


def _create(name: str) -> Path:
    for path in _numbered(name):
        try:
            path.mkdir()
        except FileExistsError:
            continue
        except OSError as error:
            raise _creation_error(path, error) from error
        sync_folder(path.parent)
        return path
    raise AssertionError(name)


def _creation_error(path: Path, error: OSError) -> OutputError:
    here = path.parent == Path()
    return OutputError(
        f"cannot make the folder {path} ({error.strerror})",
        "choose another one with -o",
        _other(Path.home() / path.name if here else Path(path.name)),
    )


def _other(path: Path) -> str:
    """Return the option that names another folder, `path` or a free name like it."""
    return f"-o {shlex.quote(str(free_name(path)))}"


def _lock(path: Path, only: bool) -> int | None:
    """Lock the folder, and return its handle; None if the system cannot open folders. `only` : see OutputFolder."""
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
            f"another mpucal{holder} writes to {path}",
            "wait until it ends" + ("" if only else ", or choose another folder with -o"),
            "" if only else _other(path),
        ) from error
    except OSError:
        # A network disk may not support locks.
        pass
    return handle


def _holder(handle: int) -> str:
    """Return the process that has the lock, from the kernel's list (proc(5)); empty if it is not in the list."""
    inode = str(os.fstat(handle).st_ino)
    with suppress(OSError, IndexError):
        for line in Path("/proc/locks").read_text(encoding="ascii").splitlines():
            _, kind, _, _, process, where, *_ = line.split()
            if kind == "FLOCK" and where.rpartition(":")[2] == inode:
                return f" (process {process})"
    return ""
