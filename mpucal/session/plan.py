"""Settings of a session (sensor, gravity, model, target), and their form in the head of its capture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Self

from ..arguments import LEAST_GRAVITY_MPS2, MOST_GRAVITY_MPS2
from ..chip.config import Config
from ..data import STANDARD_GRAVITY_MPS2
from ..errors import CaptureError
from ..files.recorders import CHIP, DRIVER, recorder_of
from .aims import AIMS, NORMAL
from .boards import BOARDS

PLAN = "plan"


@dataclass(frozen=True)
class Plan:
    """Settings of a session: with them, the bytes and the keys of a capture decide all that it does.

    Attributes
    ----------
    config : the chip's settings. gravity : local gravity [m/s^2]. model : the parameters to estimate.
    until_end : no step has a time limit, and the turning ends with the source.
    target : one of AIMS. tilt_only : the board cannot be turned over.
    attended : somebody can press keys. gravity_anyway : allow a gravity outside the range found on Earth.
    board : kind of board, one of BOARDS, for the words of the prompts; empty: the sensor's.
    """

    config: Config = field(default_factory=Config)
    gravity: float = STANDARD_GRAVITY_MPS2
    model: str = "auto"
    until_end: bool = False
    target: str = NORMAL
    tilt_only: bool = False
    attended: bool = False
    gravity_anyway: bool = False
    board: str = ""

    def __post_init__(self) -> None:
        """Raise ValueError for settings of a damaged capture that no session has."""
        fits = (
            LEAST_GRAVITY_MPS2 <= self.gravity <= MOST_GRAVITY_MPS2
            and self.target in list(AIMS)
            and self.board in ("", *BOARDS)
        )
        if not fits:
            raise ValueError(f"gravity {self.gravity!r}, target {self.target!r}, board {self.board!r}")

    def meta(self) -> dict[str, Any]:
        """Return the head of a capture, in JSON's own types."""
        return {DRIVER: CHIP.version, PLAN: asdict(self)}

    @classmethod
    def of_capture(cls, meta: Mapping[str, Any], name: str) -> Self:
        """Return the plan of the capture `name`, from its head.

        Raises
        ------
        CaptureError : another version of the driver recorded it, or its head holds no plan.
        """
        recorder = recorder_of(meta, name, same=True)
        try:
            plan = dict(meta[PLAN])
            return cls(**{**plan, "config": recorder.config(**plan["config"])})
        except (KeyError, TypeError, ValueError) as error:
            raise CaptureError(
                f"the head of {name} does not hold the session's settings ({error})", "use `mpucal calibrate`"
            ) from error
