"""Error numbers of the kernel for the files of an IIO device, converted to sentences.

Source: Linux drivers/iio/industrialio-buffer.c and industrialio-trigger.c; they hold as of Linux 6.1.
"""

from __future__ import annotations

import errno

from ..errors import BusError, NoAnswer

GONE_ERRNOS = (errno.ENODEV, errno.ENOENT, errno.ENXIO)


def file_error(error: OSError, device: str, name: str = "the buffer", text: str | None = None) -> BusError:
    """Convert the error of reading the attribute `name` or the buffer, or of writing `text` to an attribute."""
    verb = "read" if text is None else "write"
    if error.errno in (errno.EACCES, errno.EPERM):
        remedy = "run it as root (sudo), or use --trigger none, which polls and writes nothing"
        return BusError(f"no permission to {verb} {name} of {device}", remedy)
    if error.errno == errno.EBUSY:
        remedy = f"stop it (`sudo fuser -v /dev/{device}` names it), and start again"
        return BusError(f"another program reads the buffer of {device}", remedy)
    if error.errno in GONE_ERRNOS:
        remedy = "its driver was unbound or its adapter unplugged: bring it back, and start again"
        return NoAnswer(f"{device} is gone", remedy)
    if text is not None and error.errno in (errno.EINVAL, errno.ERANGE):
        what = f"the driver of {device} does not accept {text!r} for {name}"
        return BusError(what, "use another --rate, range or --trigger")
    return BusError(
        f"the driver of {device} cannot {verb} {name} ({error.strerror})",
        "check the sensor's wires and supply, and the output of `dmesg`",
    )
