"""Journal of a batch: a line of JSON for each finished row, so that a killed batch can be continued."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ..disk.atomic import mode_of_existing
from ..errors import OutputError


class RowJournal:
    """Rows of a batch in a file, the latest of each path; only their positions are in memory.

    Parameters
    ----------
    settings : (path) -> text of the settings on which a row depends; a row of other settings does not count.

    Raises
    ------
    OutputError : the file cannot be read or written.
    """

    def __init__(self, file: Path, settings: Callable[[str], str]) -> None:
        self._settings = settings
        # path -> offset of its line, and digest of its file
        self._known: dict[str, tuple[int, str | None]] = {}
        with _writing(file):
            mode_of_existing(file)
            self._file = file.open("a+b")
            self._read()

    def close(self) -> None:
        """Close the file; a row that could not be written is given up."""
        with suppress(OSError):
            self._file.close()

    def digest(self, path: str) -> str | None:
        """Return the digest of the file of a row; None if there is no row, or the file could not be read."""
        return self._known.get(path, (0, None))[1]

    def add(self, row: dict[str, Any]) -> None:
        """Append a row and flush it."""
        with _writing(Path(self._file.name)):
            self._file.seek(0, 2)
            self._known[row["path"]] = (self._file.tell(), row.get("digest"))
            self._file.write(json.dumps({"settings": self._settings(row["path"]), "row": row}).encode() + b"\n")
            self._file.flush()

    def rows(self, paths: Sequence[str]) -> Iterator[dict[str, Any]]:
        """Yield the existing rows of paths, in the order of paths."""
        for path in paths:
            if path in self._known:
                self._file.seek(self._known[path][0])
                row: dict[str, Any] = json.loads(self._file.readline())["row"]
                yield row

    def _read(self) -> None:
        self._file.seek(0)
        at = 0
        for line in self._file:
            begin, at = at, at + len(line)
            try:
                content = json.loads(line)
                path = content["row"]["path"]
                if content["settings"] == self._settings(path):
                    self._known[path] = (begin, content["row"].get("digest"))
            except (ValueError, KeyError, TypeError):
                # the line was cut by a kill
                continue
        self._file.seek(0, 2)
        if at and not line.endswith(b"\n"):
            self._file.write(b"\n")


@contextmanager
def _writing(file: Path) -> Iterator[None]:
    """Convert an OSError of the block."""
    try:
        yield
    except OSError as error:
        raise OutputError(
            f"cannot write {file} ({error.strerror or error})",
            "free space there, or choose another -o; finished rows are kept",
        ) from error
