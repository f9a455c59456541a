"""Atomic writing of files: a crash leaves the old file or the new one, never a part."""

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
    """Raise UsageError if `target` is one of `inputs`: a result must not replace what it is made of."""
    if target.exists() and any(read.exists() and target.samefile(read) for read in inputs):
        raise UsageError(f"{target} is an input file", "choose another name with -o")


def write_atomically(path: Path, data: bytes) -> None:
    """Write `data` to `path`; see atomic_file.

    Raises
    ------
    OutputError : the folder or file cannot be written.
    """
    with atomic_file(Path(path)) as file:
        file.write(data)


def write_together(files: Mapping[Path, bytes]) -> None:
    """Write all files; if one of them cannot be written, restore the old ones.

    A crash between two files leaves the old file of the second.

    Raises
    ------
    OutputError : a folder or file cannot be written.
    """
    old = {path: _read_old(path) for path in files}
    try:
        with ExitStack() as stack:
            # The file that is entered last is replaced first.
            for path in reversed(list(files)):
                file = stack.enter_context(atomic_file(path))
                file.write(files[path])
                file.flush()
    except BaseException:
        for path, data in old.items():
            with suppress(OSError, OutputError):
                _restore(path, data)
        raise


def _read_old(path: Path) -> bytes | None:
    try:
        return path.read_bytes() if path.is_file() else None
    except OSError as error:
        raise OutputError(
            f"cannot write {path}, since the old file cannot be read ({error.strerror})",
            "choose another folder with -o",
        ) from error


def remove_file(path: Path) -> None:
    """Remove a file, but not a link, a device or a pipe."""
    with suppress(OSError, OutputError):
        if mode_of_existing(path) is not None:
            path.unlink()


def _restore(path: Path, data: bytes | None) -> None:
    if data is None:
        remove_file(path)
    elif path.read_bytes() != data:
        write_atomically(path, data)


@contextmanager
def atomic_file(path: Path) -> Iterator[IO[bytes]]:
    """Open a temporary file that replaces `path` at the end of the `with` block; an error keeps the old one.

    Raises
    ------
    OutputError : the folder or file cannot be written, or `path` is a link, device or pipe.
    """
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    rights = mode_of_existing(path)
    made = False
    try:
        # A new file gets the permissions of the umask; an old one keeps its own.
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
            "choose a folder with space and permission to write with -o",
        ) from error


def make_folders(folder: Path) -> None:
    """Create `folder` and its missing parents, and sync them.

    Raises
    ------
    OSError : one cannot be created.
    """
    missing = [each for each in (folder, *folder.parents) if not each.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    for each in missing:
        sync_folder(each.parent)


def sync_folder(folder: Path) -> None:
    """Sync the names in `folder`, so that a power cut keeps them; an error of the disk is ignored."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
