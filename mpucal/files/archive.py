"""Packed recordings: a .gz file, and a .zip archive of one recording, of a folder, or of several of one sensor."""

from __future__ import annotations

import gzip
import zipfile
from pathlib import Path
from tempfile import TemporaryDirectory

from ..data import Recording
from ..errors import RecordingError
from . import formats
from .hints import NO_HINTS, Hints
from .reading import DAMAGED_ZIP, LONGEST_LINE, check_size, whole


def is_archive(path: Path) -> bool:
    """Return True if a packed file has the name of a recording."""
    try:
        return any(formats.is_suffix(Path(name).suffix) for name in _members(path))
    except (OSError, *DAMAGED_ZIP):
        return False


def load_archive(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """Return the recording in an archive.

    Raises
    ------
    RecordingError : it cannot be unpacked, or holds no recording.
    """
    with TemporaryDirectory() as folder:
        into = Path(folder) / path.name
        with whole(path, "archive", "export the recording again", DAMAGED_ZIP):
            _unpack(path, into)
        found = into
        while found.is_dir() and (only := _only_one_in(found)):
            found = only
        if found.is_file() and found.suffix.lower() in formats.PACKED.split():
            raise RecordingError(f"{path} holds another archive, {found.name}", "unpack it, and give what it holds")
        try:
            return formats.find_format(found, hints).read(found, hints=hints)
        except RecordingError as error:
            what, remedy = (text.replace(f"{folder}/", "") for text in (error.what, error.remedy))
            raise RecordingError(what, remedy, error.options) from error


def _only_one_in(folder: Path) -> Path | None:
    """Return the only file or folder in a folder, or the only recording beside texts about it; None of several."""
    inside = [*folder.iterdir()]
    found = inside if len(inside) == 1 else [*filter(formats.recognise, inside)]
    return found[0] if len(found) == 1 else None


def _members(path: Path) -> list[str]:
    """Return the names of an archive's files, without those of the computer that made it."""
    if path.suffix.lower() == ".gz":
        return [path.stem]
    with zipfile.ZipFile(path) as archive:
        names = [name for name in archive.namelist() if not name.endswith("/")]
    return [name for name in names if not any(part.startswith((".", "__")) for part in Path(name).parts)]


def _unpack(path: Path, into: Path) -> None:
    into.mkdir()
    members = _members(path)
    if path.suffix.lower() == ".gz":
        try:
            with gzip.open(path) as packed, (into / members[0]).open("wb") as file:
                while data := packed.read(LONGEST_LINE):
                    check_size(path, file.tell() + file.write(data))
        except gzip.BadGzipFile as error:  # an error of the file's content, and not of its path
            raise EOFError(str(error)) from error
        return
    with zipfile.ZipFile(path) as archive:
        check_size(path, sum(archive.getinfo(name).file_size for name in members))
        for name in members:
            archive.extract(name, into)
