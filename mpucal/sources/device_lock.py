"""A chip is one process's: of two, each would empty the other's FIFO. By a lock that ends with the process."""

from __future__ import annotations

from ..errors import BusError


def lock_device(handle: int | None, chip: str, remedy: str = "end it", address: int = 0) -> None:
    """Keep other sessions from `chip`, behind an open device.

    The lock is on the byte of that address (fcntl(2)), so that two chips on one bus are two; a device that knows no
    locks is anybody's.

    Raises
    ------
    BusError : another process has it.
    """
    try:
        import fcntl  # noqa: PLC0415 - not on Windows, which has no such bus

        if handle is not None:
            fcntl.lockf(handle, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, address)
    except (BlockingIOError, PermissionError) as error:
        raise BusError(f"another mpucal uses {chip}", remedy) from error
    except (ImportError, OSError, TypeError):
        return
