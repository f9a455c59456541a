"""Error numbers of the kernel for the files of an IIO device, converted to sentences.

Source: Linux drivers/iio/industrialio-buffer.c and industrialio-trigger.c; they hold as of Linux 6.1.
"""

from __future__ import annotations

import errno

from ..errors import BusError, NoAnswer

GONE_ERRNOS = (errno.ENODEV, errno.ENOENT, errno.ENXIO)


def attribute_error(error: OSError, device: str, name: str, text: str | None) -> BusError:
    """Convert the error of reading an attribute, or of writing `text` to it."""
    if error.errno in (errno.EACCES, errno.EPERM):
        verb = "read" if text is None else "write"
        return BusError(
            f"no permission to {verb} {name} of {device}",
            "run it as root (sudo), or use --trigger none, which polls and writes nothing",
        )
    if error.errno == errno.EBUSY:
        return in_use(device)
    if error.errno in GONE_ERRNOS:
        return gone(device)
    if text is not None and error.errno in (errno.EINVAL, errno.ERANGE):
        return BusError(
            f"the driver of {device} does not accept {text!r} for {name}", "use another --rate, range or --trigger"
        )
    return BusError(
        f"the driver of {device} cannot {'read' if text is None else 'write'} {name} ({error.strerror})",
        "check the sensor's wires and supply, and the output of `dmesg`",
    )


def buffer_error(error: OSError, device: str) -> BusError:
    """Convert the error of opening or reading the buffer."""
    if error.errno in (errno.EACCES, errno.EPERM):
        return BusError(
            f"no permission to read /dev/{device}", "run it as root (sudo), or use --trigger none, which polls"
        )
    if error.errno == errno.EBUSY:
        return in_use(device)
    if error.errno in GONE_ERRNOS:
        return gone(device)
    return BusError(
        f"the buffer of {device} cannot be read ({error.strerror})", "check the output of `dmesg`, and start again"
    )


def in_use(device: str) -> BusError:
    """Return the error of a buffer that another program has open."""
    return BusError(
        f"another program reads the buffer of {device}",
        f"stop it (`sudo fuser -v /dev/{device}` names it), and start again",
    )


def gone(device: str) -> NoAnswer:
    """Return the error of a device that vanished."""
    return NoAnswer(
        f"{device} is gone", "its driver was unbound or its adapter unplugged: bring it back, and start again"
    )
