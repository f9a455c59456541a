"""Fixture for pytest that replays sessions and compares their calibrations with the stored ones.

pytest_plugins = ["mpucal.testing"]  # in a conftest.py
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable
from os import PathLike
from pathlib import Path

import numpy as np
import pytest

from .__main__ import run
from .result.calibration import Calibration
from .result.session_files import DOCUMENT

Replay = Callable[..., Calibration]


@pytest.fixture
def mpucal_replay(tmp_path: Path) -> Replay:
    """Return a function that replays the session in a folder, and fails the test if its calibration differs now.

    Parameters
    ----------
    folder : with the session's capture and calibration.json.
    tolerance : of each element of D, and of b_a in m/s^2; 1e-9 also holds between processors.

    Returns
    -------
    The new Calibration.
    """

    def replay(folder: str | PathLike[str], tolerance: float = 1e-9) -> Calibration:
        folder, into = Path(folder), tmp_path / f"replay of {Path(folder).name}"
        then = Calibration.load(folder / DOCUMENT.name)
        messages = io.StringIO()
        with contextlib.redirect_stderr(messages), contextlib.redirect_stdout(io.StringIO()):
            run(["session", "--replay", str(folder), "--yes", "--no-write", "-o", str(into)])
        if not (into / DOCUMENT.name).exists():
            pytest.fail(f"{folder} does not replay: {messages.getvalue().splitlines()[-1]}", pytrace=False)
        now = Calibration.load(into / DOCUMENT.name)
        for name in ("D", "b_a"):
            changed = f"{folder}: {name} has changed"
            np.testing.assert_allclose(getattr(now, name), getattr(then, name), rtol=0, atol=tolerance, err_msg=changed)
        assert now.verdict == then.verdict, f"{folder}: the verdict has changed"
        return now

    return replay
