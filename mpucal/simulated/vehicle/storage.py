"""Card of a simulated vehicle, behind MAVLink FTP."""

from __future__ import annotations

from ...mavlink.ftp import MOST_DATA, SEQUENCE, ErrorCode, Opcode, Payload


class Card:
    """Files by path, with one session at a time.

    Parameters
    ----------
    folder : the only one in which files can be created; None: there is no card.
    """

    def __init__(self, folder: str | None) -> None:
        self.files: dict[str, bytes] = {}
        self._folder = folder
        self._open: str | None = None
        self._last: Payload | None = None

    def answer(self, asked: Payload) -> Payload:
        """Return the reply; a repeated request gets the same one."""
        sequence = (asked.sequence + 1) % SEQUENCE
        if self._last is not None and self._last.sequence == sequence:
            return self._last
        done = self._execute(asked)
        opcode, data = (Opcode.NAK, bytes([done])) if isinstance(done, ErrorCode) else (Opcode.ACK, done)
        self._last = Payload(sequence, asked.session, opcode, data, asked.offset, None, asked.opcode)
        return self._last

    def _execute(self, asked: Payload) -> bytes | ErrorCode:
        path = asked.data.decode("ascii", "replace")
        if asked.opcode in (Opcode.RESET, Opcode.TERMINATE):
            self._open = None
            return b""
        if asked.opcode == Opcode.CREATE:
            if self._folder is None or not path.startswith(self._folder):
                return ErrorCode.NOT_FOUND
            self.files[path], self._open = b"", path
            return b""
        if asked.opcode in (Opcode.OPEN_TO_READ, Opcode.REMOVE):
            return self._existing(path, asked.opcode)
        if asked.opcode in (Opcode.READ, Opcode.WRITE) and self._open is not None:
            return self._move(self._open, asked)
        return ErrorCode.FAIL

    def _existing(self, path: str, opcode: int) -> bytes | ErrorCode:
        if path not in self.files:
            return ErrorCode.NOT_FOUND
        if opcode == Opcode.REMOVE:
            del self.files[path]
            return b""
        self._open = path
        return len(self.files[path]).to_bytes(4, "little")

    def _move(self, path: str, asked: Payload) -> bytes | ErrorCode:
        held, at = self.files[path], asked.offset
        if asked.opcode == Opcode.WRITE:
            self.files[path] = held[:at].ljust(at, b"\0") + asked.data + held[at + len(asked.data) :]
            return b""
        part = held[at : at + min(asked.size or MOST_DATA, MOST_DATA)]
        return part or ErrorCode.END_OF_FILE
