"""Libraries that only some files need, which an extra of the package installs."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

from ..errors import RecordingError


def library(name: str, extra: str, path: Path) -> Any:
    """The module of that name.

    Raises
    ------
    RecordingError : it is not installed.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise RecordingError(
            f"{path} is read with {name.partition('.')[0]}, which is not installed", f"pip install 'mpucal[{extra}]'"
        ) from error
