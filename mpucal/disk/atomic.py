"""Atomic writing of files: after a crash the old file is there or the new one, never a part."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import IO

from ..errors import OutputError, UsageError
from .location import mode_of_existing


def check_not_input(target: Path, inputs: Iterable[Path]) -> None:
    """A result never takes the place of what it was made of; UsageError where `target` is one of `inputs`."""
    if target.exists() and any(read.exists() and target.samefile(read) for read in inputs):
        raise UsageError(f"{target} is what was given to be read", "choose another name with -o")


def write_atomically(path: Path, data: bytes) -> None:
    """Write `data` to `path` so that a crash leaves the old file or the new one, never a part.

    Raises
    ------
    OutputError : the folder or file cannot be written.
    """
    with atomic_file(Path(path)) as file:
        file.write(data)


def write_together(files: Mapping[Path, bytes]) -> None:
    """Write all files, or, where one cannot be written, none: the old ones are there again.

    A crash between two of them leaves the old one of the second.

    Raises
    ------
    OutputError : a folder or file cannot be written.
    """
    old = {path: _held(path) for path in files}
    try:
        with ExitStack() as stack:
            # what is entered last takes its place first
            for path in reversed(list(files)):
                file = stack.enter_context(atomic_file(path))
                file.write(files[path])
                file.flush()
    except BaseException:
        for path, data in old.items():
            with suppress(OSError, OutputError):
                _put_back(path, data)
        raise


def _held(path: Path) -> bytes | None:
    try:
        return path.read_bytes() if path.is_file() else None
    except OSError as error:
        raise OutputError(
            f"cannot write {path}, as what is there cannot be read ({error.strerror})", "choose another folder with -o"
        ) from error


def remove_file(path: Path) -> None:
    """Remove a file; what is none stays."""
    with suppress(OSError, OutputError):
        if mode_of_existing(path) is not None:
            path.unlink()


def _put_back(path: Path, data: bytes | None) -> None:
    if data is None:
        remove_file(path)
    elif path.read_bytes() != data:
        write_atomically(path, data)


@contextmanager
def atomic_file(path: Path) -> Iterator[IO[bytes]]:
    """A file to be filled, which takes the place of `path` once it is; whatever fails meanwhile leaves the old one.

    Raises
    ------
    OutputError : the folder or file cannot be written, or there is a link, device or pipe of that name.
    """
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    rights = mode_of_existing(path)
    made = False
    try:
        # the umask is the person's; what is there keeps its rights
        with temporary.open("x+b") as file:
            made = True
            if rights is not None:
                temporary.chmod(rights)
            yield file
            file.flush()
            os.fsync(file.fileno())
        mode_of_existing(path)
        temporary.replace(path)
        sync_folder(path.parent)
    except BaseException as error:
        if made:
            temporary.unlink(missing_ok=True)
        if not isinstance(error, OSError):
            raise
        raise OutputError(
            f"cannot write {path} ({error.strerror or error})",
            "choose a folder that you may write to with -o",
        ) from error


def make_folders(folder: Path) -> None:
    """Make `folder`, and those that it lies in, where they are missing, so that a power cut leaves them there.

    Raises
    ------
    OSError : one cannot be made.
    """
    missing = [each for each in (folder, *folder.parents) if not each.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    for each in missing:
        sync_folder(each.parent)


def sync_folder(folder: Path) -> None:
    """See to it that a power cut leaves the names in `folder` as they are now; a disk that fails does not matter."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
