"""Where an open file or folder is: somebody may have renamed it, or put another in its place."""

from __future__ import annotations

import os
import stat
from contextlib import suppress
from pathlib import Path

from ..errors import OutputError


def current_path(handle: int, path: Path) -> Path | None:
    """Where the file or folder behind `handle` is now, `path` where it is still there; None where it has no name."""
    link = Path(f"/proc/self/fd/{handle}")
    # Linux tells where a file went
    for found in (path, link.readlink() if link.is_symlink() else path):
        with suppress(OSError):
            if os.path.samestat(os.fstat(handle), found.stat()):
                return found
    return None


def mode_of_existing(path: Path) -> int | None:
    """The rights of the file at `path`, which a new one may replace; None where there is none.

    Raises
    ------
    OutputError : it is a link, a device or a pipe: none of these is ever replaced.
    """
    try:
        mode = path.lstat().st_mode
    except FileNotFoundError:
        return None
    except OSError as error:
        raise OutputError(f"cannot write {path} ({error.strerror})", "choose another place with -o") from error
    if stat.S_ISLNK(mode):
        raise OutputError(f"{path} is a link, which is not written over", "name what it leads to, or another file")
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise OutputError(f"{path} is a device or pipe, and no file", "choose another name with -o")
    return stat.S_IMODE(mode)


def check_free(path: Path) -> None:
    """OutputError where `path` is anything already: what is recorded goes to a file of its own."""
    if os.path.lexists(path):
        raise OutputError(f"{path} is there already", "choose another file with -o")
