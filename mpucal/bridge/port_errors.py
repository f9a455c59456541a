"""Errors of a serial port as sentences."""

from __future__ import annotations

import errno
import re

from ..errors import BusError, LinkError

AUTOPILOT = re.compile("ardupilot|px4", re.IGNORECASE)


def opening_error(error: Exception, port: str) -> BusError:
    """Convert the error of a port that did not open."""
    number, words = getattr(error, "errno", None), str(error)
    if number == errno.ENOENT or (number is None and "No such file" in words):
        return BusError(f"there is no serial port {port}", other_ports())
    if number == errno.EACCES or "Permission denied" in words:
        return BusError(
            f"no permission to use {port}",
            "add yourself to its group: sudo usermod -aG dialout $USER, then log in again",
        )
    if number in (errno.EBUSY, errno.EAGAIN) or "exclusively lock" in words:
        return BusError(f"another program uses {port}", "close it (a serial monitor, perhaps), then try again")
    if number in (errno.ECONNREFUSED, errno.EHOSTUNREACH, errno.ETIMEDOUT) or "://" in port:
        return BusError(
            f"cannot connect to {port} ({_reason(error)})", "check the address, and that a server runs there"
        )
    if isinstance(error, ValueError) or number in (errno.ENOTTY, errno.EINVAL, errno.EISDIR, None):
        return BusError(f"{port} is not a serial port ({_reason(error)})", other_ports())
    return BusError(f"cannot open {port} ({_reason(error)})", other_ports())


def port_gone(port: str) -> LinkError:
    """Return the error of a port that was there and is not any more."""
    return LinkError(f"{port} is gone", "check its cable, plug it in again, then start again")


def ports() -> list[tuple[str, str]]:
    """List the serial ports with a device behind them: (name, description)."""
    from serial.tools.list_ports import comports  # noqa: PLC0415 - only needed for an error

    return [(port.device, port.description) for port in sorted(comports()) if port.hwid != "n/a"]


def boards() -> list[tuple[str, str]]:
    """List the ports but those of autopilots."""
    return [port for port in ports() if not AUTOPILOT.search(port[1])]


def autopilots() -> list[tuple[str, str]]:
    """List the ports whose USB description names an autopilot's firmware."""
    return [port for port in ports() if AUTOPILOT.search(port[1])]


def other_ports() -> str:
    """Return the remedy for a missing or wrong port: the ports that there are."""
    there = [f"{port} ({what})" for port, what in ports()]
    return f"use one of {', '.join(there)}" if there else "connect the bridge (no serial ports found)"


def _reason(error: Exception) -> str:
    """Return the system's message, which pyserial wraps in its own."""
    found = re.findall(r"\[Errno \d+\] ([^:']+)|\(\d+, '([^']+)'\)", str(error))
    return "".join(found[-1]) if found else str(error)
