"""What the kernel's error numbers mean on the files of an IIO device, as sentences.

Source: Linux drivers/iio/industrialio-buffer.c and industrialio-trigger.c; they hold as of Linux 6.1.
"""

from __future__ import annotations

import errno

from ..errors import BusError, NoAnswer

GONE = (errno.ENODEV, errno.ENOENT, errno.ENXIO)


def attribute_error(error: OSError, device: str, name: str, text: str | None) -> BusError:
    """Why an attribute cannot be read, or `text` cannot be written to it."""
    if error.errno in (errno.EACCES, errno.EPERM):
        verb = "read" if text is None else "write"
        return BusError(
            f"no permission to {verb} {name} of {device}",
            "run it as root (sudo), or give --trigger none, which polls and writes nothing",
        )
    if error.errno == errno.EBUSY:
        return in_use(device)
    if error.errno in GONE:
        return gone(device)
    if text is not None and error.errno in (errno.EINVAL, errno.ERANGE):
        return BusError(
            f"the driver of {device} does not take {text!r} for {name}", "take another --rate, range or --trigger"
        )
    return BusError(
        f"the driver of {device} cannot {'read' if text is None else 'write'} {name} ({error.strerror})",
        "check the sensor's wires and supply, and what `dmesg` says",
    )


def buffer_error(error: OSError, device: str) -> BusError:
    """Why the buffer cannot be opened or read."""
    if error.errno in (errno.EACCES, errno.EPERM):
        return BusError(
            f"no permission to read /dev/{device}", "run it as root (sudo), or give --trigger none, which polls"
        )
    if error.errno == errno.EBUSY:
        return in_use(device)
    if error.errno in GONE:
        return gone(device)
    return BusError(
        f"the buffer of {device} cannot be read ({error.strerror})", "see what `dmesg` says, and start again"
    )


def in_use(device: str) -> BusError:
    """Another program has the buffer."""
    return BusError(
        f"another program reads the buffer of {device}",
        f"stop it (`sudo fuser -v /dev/{device}` names it), and start again",
    )


def gone(device: str) -> NoAnswer:
    """The device vanished."""
    return NoAnswer(
        f"{device} is gone", "its driver was unbound or its adapter unplugged: bring it back, and start again"
    )
