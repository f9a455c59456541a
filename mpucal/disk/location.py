"""Location of files and folders: where an open one is now, and what a new one would replace."""

from __future__ import annotations

import os
import stat
from contextlib import suppress
from pathlib import Path

from ..errors import OutputError


def current_path(handle: int, path: Path) -> Path | None:
    """Return the present path of an open file or folder, `path` if it is still there; None if it was removed."""
    link = Path(f"/proc/self/fd/{handle}")
    # On Linux the link shows the new path of a renamed file.
    for found in (path, link.readlink() if link.is_symlink() else path):
        with suppress(OSError):
            if os.path.samestat(os.fstat(handle), found.stat()):
                return found
    return None


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
