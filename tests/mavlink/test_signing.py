"""The forms in which a key for signed packets is given."""

import hashlib

import pytest

from mpucal.errors import UsageError
from mpucal.mavlink.signing import read_key

KEY = bytes(range(32))


@pytest.mark.parametrize(
    ("content", "key"),
    [
        (KEY, KEY),
        (KEY.hex().encode() + b"\n", KEY),
        (b"correct horse\n", hashlib.sha256(b"correct horse").digest()),
    ],
    ids=["bytes", "hexadecimal", "passphrase"],
)
def test_the_forms_of_a_key(content, key, tmp_path):
    (tmp_path / "key").write_bytes(content)
    assert read_key(tmp_path / "key") == key


def test_an_empty_key_is_refused(tmp_path):
    (tmp_path / "key").write_bytes(b" \n")
    with pytest.raises(UsageError, match="is empty"):
        read_key(tmp_path / "key")
