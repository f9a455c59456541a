"""Files, folders, globs and URLs of fsspec: found, fetched and identified."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from glob import glob, has_magic
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any

from ..arguments import check_regular, reading
from ..errors import RecordingError, UsageError
from ..result.session_files import captures_in


def expand(words: Iterable[str]) -> list[str]:
    """Return the paths and URLs of words, each once, in their order; a glob's matches are sorted by name.

    Raises
    ------
    RecordingError : a glob matches nothing. UsageError : fsspec is not installed, or does not know such a URL.
    """
    paths: list[str] = []
    for word in words:
        remote = "://" in word
        # the question mark of a URL begins its query
        if not has_magic(word.partition("?")[0] if remote else word):
            paths.append(word)
            continue
        matches = _expand_url(word) if remote else sorted(glob(word, recursive=True))  # noqa: PTH207 - patterns may be absolute
        if not matches:
            raise RecordingError(f"nothing matches {word}", "check the pattern")
        paths += matches
    return list(dict.fromkeys(paths))


@contextmanager
def fetch(path: str) -> Iterator[Path]:
    """Yield a local path; a URL of fsspec is copied to a temporary file for the block.

    Raises
    ------
    RecordingError : the URL cannot be read.
    """
    if "://" not in path:
        yield Path(path)
        return
    import fsspec  # noqa: PLC0415

    with TemporaryDirectory(prefix="mpucal-") as folder:
        # a signed URL continues after the name
        local = Path(folder) / PurePosixPath(path.partition("?")[0]).name
        try:
            system, there = fsspec.core.url_to_fs(path)
            if system.isdir(there):
                system.get(there, str(local), recursive=True)
            else:
                # get would read a signed URL's question mark as a pattern
                system.get_file(there, str(local))
        except Exception as error:
            do = _install_hint(path) if isinstance(error, ImportError) else "check it, and that this worker may read it"
            raise RecordingError(f"cannot fetch {path} ({type(error).__name__}: {error})", do) from error
        yield local


def compute_digest(path: Path) -> str:
    """Return the SHA-256 of a file; for a folder, of its captures or else of all its files, by name.

    Raises
    ------
    RecordingError : it cannot be read, or is a pipe or device, which may never end.
    """
    digest = hashlib.sha256()
    check_regular(path)
    with reading(path):
        files = [path]
        if path.is_dir():
            files = captures_in(path) or sorted(each for each in path.rglob("*") if each.is_file())
        for each in files:
            with each.open("rb") as file:
                digest.update(hashlib.file_digest(file, "sha256").digest())
    return digest.hexdigest()


def _expand_url(word: str) -> list[str]:
    try:
        import fsspec  # noqa: PLC0415

        system: Any = fsspec.core.url_to_fs(word)[0]
        return sorted(system.unstrip_protocol(path) for path in system.glob(word))
    except ImportError as error:
        raise UsageError(f"cannot list {word} ({error})", _install_hint(word)) from error
    except (ValueError, OSError) as error:
        raise UsageError(f"cannot list {word} ({error})", "check the URL and the permission to read it") from error


def _install_hint(url: str) -> str:
    """Return the remedy if fsspec lacks the package for a URL."""
    scheme = url.partition("://")[0].removesuffix("s") if url.startswith("http") else url.partition("://")[0]
    return f"pip install 'fsspec[{scheme}]', here and on the workers' machines"
