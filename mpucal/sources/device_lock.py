"""Lock on a chip: two processes would empty each other's FIFO. The lock ends with its process."""

from __future__ import annotations

from ..errors import BusError


def lock_device(handle: int | None, chip: str, remedy: str = "end it", address: int = 0) -> None:
    """Lock `chip`, behind an open device, against other sessions.

    The lock is on the byte at `address` (fcntl(2)), so that two chips on one bus have two locks. A device without
    locks is not locked.

    Raises
    ------
    BusError : another process has the lock.
    """
    try:
        import fcntl  # noqa: PLC0415 - not on Windows, which has no such bus

        if handle is not None:
            fcntl.lockf(handle, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, address)
    except (BlockingIOError, PermissionError) as error:
        raise BusError(f"another mpucal uses {chip}", remedy) from error
    except (ImportError, OSError, TypeError):
        return
