"""What can go wrong with a serial port, as sentences."""

from __future__ import annotations

import errno
import re

from ...errors import BusError, LinkError


def opening_error(error: Exception, port: str) -> BusError:
    """The sentence of an error with which a port did not open."""
    number, words = getattr(error, "errno", None), str(error)
    if number == errno.ENOENT or (number is None and "No such file" in words):
        return BusError(f"there is no serial port {port}", another())
    if number == errno.EACCES or "Permission denied" in words:
        return BusError(
            f"no permission to use {port}",
            "add yourself to its group: sudo usermod -aG dialout $USER, then log in again",
        )
    if number in (errno.EBUSY, errno.EAGAIN) or "exclusively lock" in words:
        return BusError(f"another program uses {port}", "close it (a serial monitor, perhaps), then try again")
    if number in (errno.ECONNREFUSED, errno.EHOSTUNREACH, errno.ETIMEDOUT) or "://" in port:
        return BusError(
            f"cannot connect to {port} ({_reason(error)})", "check the address, and that it is served there"
        )
    if isinstance(error, ValueError) or number in (errno.ENOTTY, errno.EINVAL, errno.EISDIR, None):
        return BusError(f"{port} is no serial port ({_reason(error)})", another())
    return BusError(f"cannot open {port} ({_reason(error)})", another())


def gone(port: str) -> LinkError:
    """The sentence of a port that was there."""
    return LinkError(f"{port} is gone", "check its cable, plug it in again, then start again")


def another() -> str:
    """What to do where no port was given, or a wrong one: the ports there are."""
    from serial.tools.list_ports import comports  # noqa: PLC0415 - only where something is wrong

    ports = [f"{port.device} ({port.description})" for port in sorted(comports()) if port.hwid != "n/a"]
    if not ports:
        return "plug the bridge in (this machine shows no serial port)"
    return f"take one of {', '.join(ports)}"


def _reason(error: Exception) -> str:
    """The system's own words, which pyserial wraps in its own."""
    found = re.findall(r"\[Errno \d+\] ([^:']+)|\(\d+, '([^']+)'\)", str(error))
    return "".join(found[-1]) if found else str(error)
