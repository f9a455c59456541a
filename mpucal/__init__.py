"""mpucal: guided accelerometer calibration for the MPU-6050 and MPU-6500, with the gyroscope's help.

    recording = mpucal.load("capture.mcap")
    calibration = mpucal.calibrate(recording)
    a = calibration.apply(acc)

The names are loaded on first use, so that `import mpucal` is fast.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .api import CheckResult, Noise, calibrate, check, load, noise
    from .data import Recording
    from .errors import MpucalError
    from .result.calibration import Calibration

__all__ = ["Calibration", "CheckResult", "MpucalError", "Noise", "Recording", "calibrate", "check", "load", "noise"]
__version__ = "0.1.0"

_HOME = {
    "Calibration": ".result.calibration",
    "CheckResult": ".recheck.outcome",
    "MpucalError": ".errors",
    "Noise": ".result.noise",
    "Recording": ".data",
    **dict.fromkeys(("calibrate", "check", "load", "noise"), ".api"),
}


if not TYPE_CHECKING:  # a type checker would accept any name

    def __getattr__(name: str) -> Any:
        if name not in _HOME:
            raise AttributeError(f"module 'mpucal' has no attribute {name!r}")
        return getattr(import_module(_HOME[name], __name__), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
