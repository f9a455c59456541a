"""A note on disk while something is written to a device: who finds it later knows that the write was cut off.

It lies in $XDG_STATE_HOME/mpucal (~/.local/state/mpucal, on Windows %LOCALAPPDATA%\\mpucal): the next run may be
in another folder.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..disk.whole import make_folders, sync_folder, write_atomically
from ..errors import OutputError
from ..strict_json import parsed
from .clock import now

AT = "at"


class Journal:
    """The note of one device; without a `path` none is kept."""

    def __init__(self, path: Path | None = None) -> None:
        self._path = path

    @classmethod
    def of(cls, sink: str, device: str) -> Journal:
        """That of a sink, by its name, behind the device that is spelled so on the command line."""
        name = hashlib.sha256(f"{sink} {device}".encode()).hexdigest()[:16]
        return cls(_state_folder() / f"write-{name}.json")

    def begin(self, content: Mapping[str, Any]) -> None:
        """Note what was there, in JSON's own types; a home that cannot be written keeps nobody from calibrating."""
        if self._path is None:
            return
        with suppress(OSError, OutputError):
            make_folders(self._path.parent)
            write_atomically(self._path, json.dumps({AT: now().isoformat(), **content}, indent=2).encode())

    def done(self) -> None:
        """The device holds one state again, the old or the new one."""
        if self._path is not None:
            # a note that stays, or that a power cut brings back, would have the next write undo this one
            try:
                self._path.unlink(missing_ok=True)
                sync_folder(self._path.parent)
            except OSError:
                with suppress(OutputError):
                    write_atomically(self._path, b"{}")

    def left(self) -> dict[str, Any] | None:
        """What a write that was cut off noted; None where none was."""
        if self._path is None:
            return None
        try:
            content = parsed(self._path.read_bytes())
        except (OSError, ValueError):
            return None
        return content if isinstance(content, dict) and AT in content else None


def _state_folder() -> Path:
    named = os.environ.get("XDG_STATE_HOME") or os.environ.get("LOCALAPPDATA")
    return (Path(named) if named else Path.home() / ".local" / "state") / "mpucal"
