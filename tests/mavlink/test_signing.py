"""Forms of the key for signed packets."""

import hashlib
import os

import pytest

from mpucal.errors import UsageError
from mpucal.mavlink.signing import read_key

KEY = bytes(range(32))


@pytest.mark.parametrize(
    ("content", "key"),
    [
        pytest.param(KEY, KEY, id="bytes"),
        pytest.param(KEY.hex().encode() + b"\n", KEY, id="hexadecimal"),
        pytest.param(b"correct horse\n", hashlib.sha256(b"correct horse").digest(), id="passphrase"),
        pytest.param(b"p" * 31 + b"\n", hashlib.sha256(b"p" * 31).digest(), id="31 and newline"),
        pytest.param(b"p" * 30 + b"\r\n", hashlib.sha256(b"p" * 30).digest(), id="30 and CRLF"),
        pytest.param(b"p" * 32, b"p" * 32, id="32 letters"),
        pytest.param(bytes(range(31)) + b"\n", bytes(range(31)) + b"\n", id="bytes, 10"),
        pytest.param(b"\xff" * 31 + b"\n", b"\xff" * 31 + b"\n", id="no text, 10"),
    ],
)
def test_the_forms_of_a_key(content, key, tmp_path):
    (tmp_path / "key").write_bytes(content)
    assert read_key(tmp_path / "key") == key


def test_an_empty_key_is_refused(tmp_path):
    (tmp_path / "key").write_bytes(b" \n")
    with pytest.raises(UsageError, match="is empty"):
        read_key(tmp_path / "key")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_or_a_long_file_is_not_a_key(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "long").write_bytes(b"p" * 5000)
    for path, what in ((tmp_path / "pipe", "a pipe or device"), (tmp_path / "long", "longer than 4096 bytes")):
        with pytest.raises(UsageError, match=what):
            read_key(path)
