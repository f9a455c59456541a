"""What is to be written to a vehicle for a calibration, or why nothing is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...data import Vector
from ...errors import WriteBackError
from ...result.calibration import REFUSED, Calibration
from ...result.comparison import is_better
from ..imu import MESSAGE_ID, SCALED, Stream
from .compose import Correction
from .document import NEW, OLD, RESIDUAL, RESIDUAL_OLD, UNCERTAIN
from .names import Slot, slot_of

NOTHING = "nothing was written"


@dataclass(frozen=True)
class Change:
    """What becomes of one IMU's parameters.

    Attributes
    ----------
    place : their names. old : what corrected the stream that was calibrated. new : what is to be written.
    mounting : R_b (3, 3). stream : where its effect shows.
    sensor_id : of the sensor that was calibrated; None where the vehicle did not say.
    residual_mps2 : by how much |a| stays wrong at worst. residual_old_mps2 : the same as it is now; None where the
        calibration does not say. uncertainty_mps2 : standard uncertainty of |a| by the calibration.
    """

    slot: Slot
    old: Correction
    new: Correction
    mounting: Vector
    stream: Stream
    sensor_id: float | None
    residual_mps2: float
    residual_old_mps2: float | None = None
    uncertainty_mps2: float = 0.0

    @property
    def imu(self) -> int:
        """Counted from 1."""
        return self.slot.imu

    @property
    def improves(self) -> bool:
        """Whether the new parameters are predicted to be better than the old ones, cross-axis residue included."""
        if self.residual_old_mps2 is None:
            return True
        return is_better(self.residual_mps2, self.residual_old_mps2, self.uncertainty_mps2)


def plan_changes(calibration: Calibration, firmware: str) -> tuple[Change, ...]:
    """A change for each IMU whose calibration holds.

    Raises
    ------
    WriteBackError : the calibration is refused, of no vehicle, of another firmware, or beyond the firmware's limits.
    """
    # a config blob says nothing of its quality: what was refused has none
    if calibration.quality.get("verdict") == REFUSED:
        raise WriteBackError(f"{NOTHING}: the calibration was refused", "repeat the session")
    of_first = calibration.extra.get("autopilot")
    if not of_first:
        raise WriteBackError(f"{NOTHING}: the calibration is of no vehicle", "give one made with --mavlink")
    try:
        others = [other for other in calibration.extra.get("others", []) if _holds(other)]
        return tuple(_change(of, firmware) for of in (of_first, *(other["autopilot"] for other in others)))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise WriteBackError(
            f"{NOTHING}: what the calibration says of its vehicle is not what a session writes"
            f" ({type(error).__name__}: {error})",
            "give the calibration.json of a session",
        ) from error


def select_improving(planned: Sequence[Change]) -> tuple[Change, ...]:
    """Those that help; all of them where none does: that they are written then is what somebody wants."""
    return tuple(change for change in planned if change.improves) or tuple(planned)


def refused_imus(calibration: Calibration) -> tuple[int, ...]:
    """The IMUs, counted from 1, whose calibration was refused."""
    others = calibration.extra.get("others", [])
    return tuple(int(other["autopilot"]["imu"]) for other in others if not _holds(other) and other.get("autopilot"))


def swap_slots(calibration: Calibration, order: Sequence[int], firmware: str) -> Calibration:
    """The same calibration, where the parameters of IMUs lie in one another's places.

    With o, k what corrected the stream, o' and k' what shall, and o_p, k_p what lies in the other place: the stream was
    corrected by o_p and k_p all the time, so that o_p + (k / k_p) (o' - o) and k' k_p / k belong there.

    Parameters
    ----------
    order : for each of those `helping`, the index of the one in whose place its parameters belong.
    """
    planned = select_improving(plan_changes(calibration, firmware))
    documents: dict[int, dict[str, Any]] = {}
    for change, index in zip(planned, order, strict=True):
        at = planned[index]
        offset = at.old.offset + change.old.scale / at.old.scale * (change.new.offset - change.old.offset)
        new = at.slot.effective(Correction(offset, change.new.scale * at.old.scale / change.old.scale))
        documents[change.imu] = {NEW: at.slot.values(new)}
    extra = dict(calibration.extra)
    extra["autopilot"] = {**extra["autopilot"], **documents[planned[0].imu]}
    extra["others"] = [
        {**other, "autopilot": {**other["autopilot"], **documents.get(other["autopilot"]["imu"], {})}}
        for other in extra.get("others", [])
    ]
    return replace(calibration, extra=extra)


def _holds(document: Mapping[str, Any]) -> bool:
    verdict = document.get("quality", {}).get("verdict", REFUSED)
    return verdict != REFUSED and bool(document.get("autopilot", {}).get(NEW))


def _check_holds(autopilot: Mapping[str, Any], *keys: str) -> None:
    lacking = [key for key in keys if autopilot.get(key) is None or (key == "message" and not _is_message(autopilot))]
    if lacking:
        raise WriteBackError(f"{NOTHING}: the calibration has no {lacking[0]} of the vehicle", "give a session's own")


def _is_message(autopilot: Mapping[str, Any]) -> bool:
    name = autopilot["message"]
    return isinstance(name, str) and name in MESSAGE_ID


def _change(autopilot: Mapping[str, Any], firmware: str) -> Change:
    _check_holds(autopilot, "imu", "firmware", OLD)
    imu = int(autopilot["imu"])
    if autopilot["firmware"] != firmware:
        raise WriteBackError(
            f"{NOTHING}: the calibration is of {autopilot['firmware']}, and this is {firmware}",
            "connect the vehicle that was calibrated",
        )
    where = slot_of(firmware, imu, autopilot[NEW])
    new = None if where is None else where.correction(autopilot[NEW])
    old = None if where is None else where.correction(autopilot[OLD])
    if where is None or new is None or old is None:
        why = autopilot.get("why", "it holds no new parameters")
        raise WriteBackError(f"{NOTHING}: the calibration does not fit the vehicle ({why})", "repeat the session")
    beyond = where.describe_excess(new)
    if beyond is not None:
        raise WriteBackError(
            f"{NOTHING}: {beyond}, which {firmware} accepts of its own calibration",
            "check that the vehicle was turned to every side, and the sensor",
        )
    _check_holds(autopilot, "message", "mounting", RESIDUAL)
    name = str(autopilot["message"])
    return Change(
        where,
        where.effective(old),
        new,
        np.array(autopilot["mounting"]),
        Stream(name, SCALED.get(name, imu)),
        autopilot[OLD].get(where.sensor_id),
        float(autopilot[RESIDUAL]),
        autopilot.get(RESIDUAL_OLD),
        float(autopilot.get(UNCERTAIN) or 0.0),
    )
