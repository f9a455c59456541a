"""What is done of a batch: a line of JSON for each row as it is finished, so that a killed batch goes on there."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from ..disk.place import mode_of_old
from ..errors import OutputError


class Journal:
    """The rows of a folder; of each path the latest, and in memory only where it stands in the file.

    Raises
    ------
    OutputError : the file cannot be read or written.
    """

    def __init__(self, file: Path, settings: str) -> None:
        self._settings = settings
        # path -> where its line begins, and its file's digest
        self._known: dict[str, tuple[int, str | None]] = {}
        try:
            mode_of_old(file)
            self._file = file.open("a+b")
            self._read()
        except OSError as error:
            raise OutputError(f"cannot write {file} ({error.strerror or error})", "choose another -o") from error

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __len__(self) -> int:
        return len(self._known)

    def digest(self, path: str) -> str | None:
        """Of the file whose row is there; None where there is none, or that could not be read."""
        return self._known.get(path, (0, None))[1]

    def add(self, row: dict[str, Any]) -> None:
        """Keep a row, on the disk as far as this program can see to it."""
        self._file.seek(0, 2)
        self._known[row["path"]] = (self._file.tell(), row.get("digest"))
        self._file.write(json.dumps({"settings": self._settings, "row": row}).encode() + b"\n")
        self._file.flush()

    def rows(self, paths: Sequence[str]) -> Iterator[dict[str, Any]]:
        """The rows of paths, in their order; those that are there."""
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
                if content["settings"] == self._settings:
                    self._known[content["row"]["path"]] = (begin, content["row"].get("digest"))
            except (ValueError, KeyError, TypeError):
                # a line that a kill has cut
                continue
        self._file.seek(0, 2)
        if at and not line.endswith(b"\n"):
            self._file.write(b"\n")
