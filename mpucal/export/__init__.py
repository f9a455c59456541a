"""A calibration in the form that somebody else's program reads. Each module is one form, and knows no other."""

from __future__ import annotations

from importlib import import_module
from typing import Protocol, cast

from ..result.calibration import Calibration

# as `--to` spells it: the module
FORMS = {
    "c-header": "c_header",
    "arduino": "arduino",
    "python": "python",
    "ros": "ros",
    "linux-iio": "linux_iio",
    "ardupilot": "ardupilot",
    "px4": "px4",
    "json": "document",
}


class Form(Protocol):
    """What every module here has.

    Attributes
    ----------
    ENDING : of the file's name.
    """

    ENDING: str

    def export(self, calibration: Calibration) -> tuple[str, tuple[str, ...]]:
        """The file's text, and what it cannot carry and what error that leaves, a sentence each.

        Raises
        ------
        RefusedError : a calibration that must not be used. WriteBackError : one that this form cannot hold.
        """
        ...


def form(name: str) -> Form:
    """The form of that name in FORMS."""
    return cast(Form, import_module(f".{FORMS[name]}", __name__))
