"""The settings of a session (sensor, gravity, model, target), and how the head of its capture stores them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Self

from ..chip.config import Config, RateOnlyConfig
from ..chip.driver import DRIVER_VERSION
from ..data import STANDARD_GRAVITY_MPS2
from ..errors import CaptureError
from ..iio import IIO_VERSION
from .aims import NORMAL

DRIVER, PLAN = "driver", "plan"
# by the version of the driver of a capture
CONFIGS: Mapping[Any, type[Config]] = {DRIVER_VERSION: Config, IIO_VERSION: RateOnlyConfig}


@dataclass(frozen=True)
class Plan:
    """What decides, with the bytes and the keys, on all that a session does.

    Attributes
    ----------
    config : how the chip measures. gravity : local gravity [m/s^2]. model : what to estimate.
    until_end : each step takes its time, and turning ends with the source.
    target : how well it is to be known, one of AIMS. tilt_only : the board cannot be turned over.
    attended : somebody can press keys. gravity_anyway : a gravity that no place on Earth has is meant.
    """

    config: Config = field(default_factory=Config)
    gravity: float = STANDARD_GRAVITY_MPS2
    model: str = "auto"
    until_end: bool = False
    target: str = NORMAL
    tilt_only: bool = False
    attended: bool = False
    gravity_anyway: bool = False

    def meta(self) -> dict[str, Any]:
        """For the head of a capture; values of JSON's own types."""
        return {DRIVER: DRIVER_VERSION, PLAN: asdict(self)}

    @classmethod
    def of_capture(cls, meta: Mapping[str, Any], name: str) -> Self:
        """The plan by which the capture `name` was made.

        Raises
        ------
        CaptureError : another driver made it, or its head does not say how.
        """
        version = meta.get(DRIVER)
        if version not in CONFIGS:
            raise CaptureError(
                f"{name} was recorded by version {version} of the driver, and this is {DRIVER_VERSION}",
                "use `mpucal calibrate` on it, which reads captures of every version",
            )
        try:
            plan = dict(meta[PLAN])
            return cls(**{**plan, "config": CONFIGS[version](**plan["config"])})
        except (KeyError, TypeError, ValueError) as error:
            raise CaptureError(
                f"the head of {name} does not say how it was made ({error})", "use `mpucal calibrate` on it"
            ) from error
