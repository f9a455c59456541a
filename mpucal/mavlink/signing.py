"""The key of MAVLink 2 signing, from a file."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

from ..errors import UsageError

KEY_BYTES = 32
_HEXADECIMAL = re.compile(rb"\s*([0-9a-fA-F]{64})\s*")


def read_key(path: Path) -> bytes:
    """The 32 bytes of a key file: as they are, as 64 hexadecimal digits, or as a passphrase's SHA-256.

    Ground stations make keys of passphrases in that way.

    Raises
    ------
    UsageError : the file cannot be read, or is empty.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise UsageError(
            f"the signing key {path} cannot be read ({error.strerror})", "check --signing-key and its permissions"
        ) from error
    if len(content) == KEY_BYTES:
        return content
    digits = _HEXADECIMAL.fullmatch(content)
    if digits:
        return bytes.fromhex(digits[1].decode())
    passphrase = content.strip()
    if not passphrase:
        raise UsageError(f"the signing key {path} is empty", "give 32 bytes, 64 hexadecimal digits, or a passphrase")
    return hashlib.sha256(passphrase).digest()
