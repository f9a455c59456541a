"""What speaks against writing a session's result by itself: nobody verified it, or what is there is as good."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from ..result.calibration import Calibration
from .sink import Sink


@runtime_checkable
class Comparing(Sink, Protocol):
    """A sink that can tell whether a calibration is predicted to be better than what it holds."""

    def as_good(self, calibration: Calibration) -> str | None:
        """Why what it holds is predicted to be as good, in a clause; None where the calibration is better.

        Raises
        ------
        SourceError : it cannot be read.
        """
        ...


def doubt(calibration: Calibration, sink: Sink) -> str | None:
    """Why a person should decide whether it is written, in a clause; None where it may be written without one.

    Raises
    ------
    SourceError : what the sink holds cannot be read.
    """
    verification = calibration.quality.get("verification")
    if not verification or verification.get("agrees") is not True:
        return "the calibration was not verified in new orientations"
    return sink.as_good(calibration) if isinstance(sink, Comparing) else None
