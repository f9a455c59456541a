"""Writing of files: atomically, where a crash leaves the old file or the new one, and never over an input or a link."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import IO

from ..errors import OutputError, UsageError


def check_not_input(target: Path, inputs: Iterable[Path]) -> None:
    """Raise UsageError if `target` is one of `inputs`: a result must not replace a file that it is made from."""
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
    temporary = path.with_name(f".{path.name}.{os.urandom(4).hex()}")
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


def mode_of_existing(path: Path) -> int | None:
    """Return the permissions of the file at `path`, which a new one may replace; None without a file.

    Raises
    ------
    OutputError : `path` is a link, a device or a pipe, which must not be replaced.
    """
    try:
        mode = path.lstat().st_mode
    except FileNotFoundError:
        return None
    except OSError as error:
        raise OutputError(f"cannot write {path} ({error.strerror})", "choose another place with -o") from error
    if stat.S_ISLNK(mode):
        raise OutputError(
            f"{path} is a link, which is not overwritten", "give the file that it points to, or another one"
        )
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise OutputError(f"{path} is a device or pipe, not a file", "choose another name with -o")
    return stat.S_IMODE(mode)


def check_free(path: Path) -> None:
    """Raise OutputError if `path` exists: a recording gets a new file."""
    if os.path.lexists(path):
        raise OutputError(f"{path} exists already", "choose another file with -o")


def current_path(handle: int, path: Path) -> Path | None:
    """Return the present path of an open file or folder, `path` if it is still there; None if it was removed."""
    link = Path(f"/proc/self/fd/{handle}")
    # On Linux the link shows the new path of a renamed file.
    for found in (path, link.readlink() if link.is_symlink() else path):
        with suppress(OSError):
            if os.path.samestat(os.fstat(handle), found.stat()):
                return found
    return None
