"""The recordings that a batch is of: files, folders, globs, and URLs of fsspec."""

from __future__ import annotations

from collections.abc import Iterable
from glob import glob, has_magic
from typing import Any

from ..errors import RecordingError, UsageError
from .row import lacking


def found(words: Iterable[str]) -> list[str]:
    """Paths and URLs in the order of the words, each once; what a glob finds by name.

    Raises
    ------
    RecordingError : a glob finds nothing. UsageError : fsspec is not installed, or knows no such URL.
    """
    paths: list[str] = []
    for word in words:
        remote = "://" in word
        # behind a question mark a URL has its query
        if not has_magic(word.partition("?")[0] if remote else word):
            paths.append(word)
            continue
        matches = _remote(word) if remote else sorted(glob(word, recursive=True))  # noqa: PTH207 - patterns may be absolute
        if not matches:
            raise RecordingError(f"nothing is found by {word}", "check the pattern")
        paths += matches
    return list(dict.fromkeys(paths))


def _remote(word: str) -> list[str]:
    try:
        import fsspec  # noqa: PLC0415

        system: Any = fsspec.core.url_to_fs(word)[0]
        return sorted(system.unstrip_protocol(path) for path in system.glob(word))
    except ImportError as error:
        raise UsageError(f"{word} cannot be looked into ({error})", lacking(word)) from error
    except (ValueError, OSError) as error:
        raise UsageError(f"{word} cannot be looked into ({error})", "check the URL and what may read it") from error
