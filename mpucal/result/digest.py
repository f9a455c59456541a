"""The digest in calibration.json, by which a number that was changed since is noticed.

"sha256:" and the hexadecimal SHA-256 of the document without its `digest` and `created`, written as JSON with sorted
keys, no blanks, ASCII alone, and every number as Python's repr of the double: the shortest decimal digits that give it
again. Without `created`, a session that is replayed has the digest of the first one.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

DIGEST, CREATED = "digest", "created"


def digest(document: Mapping[str, Any]) -> str:
    """That of a document, whatever its `digest` says."""
    text = json.dumps(
        _doubles({key: value for key, value in document.items() if key not in (DIGEST, CREATED)}),
        sort_keys=True,
        separators=(",", ":"),
    )
    return f"sha256:{hashlib.sha256(text.encode()).hexdigest()}"


def doubt(document: Mapping[str, Any]) -> str:
    """Why a document's numbers may not be those that were saved; empty where they are."""
    held = document.get(DIGEST)
    if held is None:
        return "it has no digest, so that a number in it that was damaged is not noticed"
    return "" if held == digest(document) else "its digest does not match: it was changed or damaged after it was saved"


def _doubles(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _doubles(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_doubles(item) for item in value]
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value
