"""Key of MAVLink 2 signing, read from a file."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

from ..arguments import read_limited
from ..errors import RecordingError, UsageError

KEY_BYTES = 32
# No passphrase is longer.
MOST_BYTES = 4096
_HEXADECIMAL = re.compile(rb"\s*([0-9a-fA-F]{64})\s*")


def read_key(path: Path) -> bytes:
    """Return the key in a file: its 32 bytes, its 64 hexadecimal digits, or the SHA-256 of its passphrase.

    Ground stations hash passphrases in the same way. A file of 32 bytes is the key itself, unless it is a line of
    text with its end: a passphrase of 31 or 30 letters. White space around a passphrase is ignored.

    Raises
    ------
    UsageError : the file cannot be read, is a pipe or device, longer than MOST_BYTES, or empty.
    """
    try:
        held = read_limited(path, MOST_BYTES)
    except RecordingError as error:
        raise UsageError(f"the signing key cannot be read: {error.what}", "check --signing-key") from error
    if len(held) == KEY_BYTES and not _is_line(held):
        return held
    digits = _HEXADECIMAL.fullmatch(held)
    if digits:
        return bytes.fromhex(digits[1].decode())
    passphrase = held.strip()
    if not passphrase:
        raise UsageError(f"the signing key {path} is empty", "give 32 bytes, 64 hexadecimal digits, or a passphrase")
    return hashlib.sha256(passphrase).digest()


def _is_line(held: bytes) -> bool:
    try:
        text = held.decode()
    except UnicodeDecodeError:
        return False
    return text.endswith("\n") and text.removesuffix("\n").removesuffix("\r").isprintable()
