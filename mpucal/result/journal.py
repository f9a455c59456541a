"""A note on disk during a write to a device: if it is still there later, the write was interrupted.

It is in $XDG_STATE_HOME/mpucal (~/.local/state/mpucal, on Windows %LOCALAPPDATA%\\mpucal), since the next run may be in
another folder.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..disk.atomic import make_folders, sync_folder, write_atomically
from ..errors import OutputError
from ..strict_json import parse_json
from .clock import iso_utc

AT = "at"


class Journal:
    """Note of one device; without a `path` no note is kept."""

    def __init__(self, path: Path | None = None) -> None:
        self._path = path

    @classmethod
    def of(cls, sink: str, device: str) -> Journal:
        """Return the journal of a sink, by its name, and a device, by its option on the command line."""
        name = hashlib.sha256(f"{sink} {device}".encode()).hexdigest()[:16]
        return cls(_state_folder() / f"write-{name}.json")

    def begin(self, content: Mapping[str, Any]) -> None:
        """Note the old content of the device, of JSON types; a failure to write the note is ignored."""
        if self._path is None:
            return
        with suppress(OSError, OutputError):
            make_folders(self._path.parent)
            write_atomically(self._path, json.dumps({AT: iso_utc(), **content}, indent=2).encode())

    def end(self) -> None:
        """Remove the note: the device is in one state again, the old or the new one."""
        if self._path is not None:
            # if the note stayed, or a power cut brought it back, the next write would undo this one
            try:
                self._path.unlink(missing_ok=True)
                sync_folder(self._path.parent)
            except OSError:
                with suppress(OutputError):
                    write_atomically(self._path, b"{}")

    def interrupted(self) -> dict[str, Any] | None:
        """Return the note of an interrupted write; None if there is none."""
        if self._path is None:
            return None
        try:
            content = parse_json(self._path.read_bytes())
        except (OSError, ValueError):
            return None
        return content if isinstance(content, dict) and AT in content else None


def _state_folder() -> Path:
    named = os.environ.get("XDG_STATE_HOME") or os.environ.get("LOCALAPPDATA")
    return (Path(named) if named else Path.home() / ".local" / "state") / "mpucal"
