"""What a sink keeps of the state before a write, as a JSON file that `put_back` reads."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..arguments import content
from ..disk.whole import write_atomically
from ..errors import RecordingError
from ..result.session_files import SessionFile
from ..strict_json import MOST_BYTES, parsed


def keep(file: SessionFile, folder: Path, form: str, where: str, held: Mapping[str, Any]) -> tuple[Path, ...]:
    """Save what the sink at `where` holds; an earlier file holds an earlier state, and stays."""
    path = file.free_in(folder)
    document = {"format": form, "version": 1, "where": where, **held}
    write_atomically(path, (json.dumps(document, indent=2) + "\n").encode())
    return (path,)


def kept(file: SessionFile, path: Path, form: str, *keys: str) -> dict[str, Any]:
    """What `keep` saved, of which `keys` are part.

    Raises
    ------
    RecordingError : `path` cannot be read, or holds something else.
    """
    try:
        document = parsed(content(path, MOST_BYTES))
    except ValueError as error:
        raise not_kept(file, path, str(error)) from error
    if not isinstance(document, dict) or document.get("format") != form or not document.keys() >= set(keys):
        raise not_kept(file, path, f"it has not the form {form}")
    return document


def not_kept(file: SessionFile, path: Path, why: str) -> RecordingError:
    """It does not hold `file.what`."""
    return RecordingError(f"{path} does not hold {file.what} ({why})", f"give a {file.name}")
