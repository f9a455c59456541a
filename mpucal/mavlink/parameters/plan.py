"""The parameter changes that a calibration asks for, or the reason why nothing is written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...data import Vector
from ...errors import WriteBackError
from ...result.calibration import REFUSED, Calibration
from ...result.comparison import is_better
from ..imu import Stream, live_stream
from .document import AUTOPILOT, FIRST, NEW, OLD, OTHERS, RESIDUAL, RESIDUAL_DEG, RESIDUAL_OLD, UNCERTAIN
from .mounting import Level
from .slots import Correction, Slot, slot_of

NOTHING = "nothing was written"


@dataclass(frozen=True)
class Change:
    """The change of one IMU's parameters.

    Attributes
    ----------
    slot : their names. old : the correction of the stream that was calibrated. new : to be written.
    mounting : R_b (3, 3). stream : shows the effect.
    sensor_id : of the sensor that was calibrated; None if the vehicle did not say.
    residual_mps2 : greatest error of |a| that is left. residual_old_mps2 : the same with the old parameters; None if
        the calibration does not say. uncertainty_mps2 : standard uncertainty of |a| by the calibration.
    residual_deg : greatest error of the direction of a that is left; None if the calibration does not say.
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
    residual_deg: float | None = None

    @property
    def imu(self) -> int:
        """Number of the IMU, counted from 1."""
        return self.slot.imu

    @property
    def residual(self) -> str:
        """Errors that the parameters leave, in words: "0.004 m/s^2 in |a| and 0.02 deg in direction"."""
        direction = "" if self.residual_deg is None else f" and {self.residual_deg:.2f} deg in direction"
        used = self.slot.effective(self.new)
        unused = ["an offset so near to 0"] if np.any(used.offset != self.new.offset) else []
        unused += ["a scale so near to 1"] if np.any(used.scale != self.new.scale) else []
        why = f" (the firmware does not use {' or '.join(unused)})" if unused else ""
        return f"{self.residual_mps2:.3f} m/s^2 in |a|{direction}{why}"

    @property
    def improves(self) -> bool:
        """True if the new parameters are predicted to be better than the old ones, cross-axis residue included."""
        if self.residual_old_mps2 is None:
            return True
        return is_better(self.residual_mps2, self.residual_old_mps2, self.uncertainty_mps2)


def plan_changes(calibration: Calibration, firmware: str) -> tuple[Change, ...]:
    """Return a change for each IMU whose calibration was not refused.

    Raises
    ------
    WriteBackError : the calibration is of no vehicle, of another firmware, or beyond the firmware's limits.
    """
    of_first = calibration.extra.get(AUTOPILOT)
    if not of_first:
        raise WriteBackError(f"{NOTHING}: the calibration is of no vehicle", "give one made with --mavlink")
    try:
        others = [other for other in calibration.extra.get(OTHERS, []) if _is_writable(other)]
        return tuple(_change(of, firmware) for of in (of_first, *(other[AUTOPILOT] for other in others)))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise WriteBackError(
            f"{NOTHING}: the calibration's entry of its vehicle is not one that a session writes"
            f" ({type(error).__name__}: {error})",
            "give the calibration.json of a session",
        ) from error


def select_improving(planned: Sequence[Change]) -> tuple[Change, ...]:
    """Return the changes that improve; all of them if none does: who writes such a calibration wants them all."""
    return tuple(change for change in planned if change.improves) or tuple(planned)


def refused_imus(calibration: Calibration) -> tuple[int, ...]:
    """Return the IMUs, counted from 1, whose calibration was refused."""
    others = calibration.extra.get(OTHERS, [])
    return tuple(int(other[AUTOPILOT]["imu"]) for other in others if not _is_writable(other) and other.get(AUTOPILOT))


def swap_slots(possible: Sequence[Change], order: Sequence[int]) -> tuple[Change, ...]:
    """Return the changes with the parameters of each improving one in the slot that acts on its IMU.

    With o, k the correction under which the stream was calibrated, o' and k' the new one, and o_p, k_p the old one in
    the other slot: the stream was corrected by o_p and k_p all the time, so that o_p + (k / k_p) (o' - o) and
    k' k_p / k belong there.

    Parameters
    ----------
    order : for each of the improving changes, the index of the one into whose slot its parameters belong.
    """
    planned = select_improving(possible)
    swapped: dict[int, Change] = {}
    for change, index in zip(planned, order, strict=True):
        at = planned[index]
        offset = at.old.offset + change.old.scale / at.old.scale * (change.new.offset - change.old.offset)
        new = at.slot.effective(Correction(offset, change.new.scale * at.old.scale / change.old.scale))
        slot = replace(at.slot, imu=change.imu)
        swapped[change.imu] = replace(change, slot=slot, old=at.old, new=new, sensor_id=at.sensor_id)
    return tuple(swapped.get(change.imu, change) for change in possible)


def adapt_to_write(calibration: Calibration, planned: Sequence[Change], level: Level) -> Calibration:
    """Return the calibration of the streams once the `planned` changes and the level are in place.

    The streams are then y' = Q (A y + c) of the y that was calibrated, where Q is the turn of the axes by the level, so
    D' = Q A D Q^T and b_a' = Q (A b_a + c).
    """
    changes, extra = {change.imu: change for change in planned}, dict(calibration.extra)
    if OTHERS in extra:
        extra[OTHERS] = [_adapt(Calibration.from_document(o), changes, level).document() for o in extra[OTHERS]]
    return _adapt(replace(calibration, extra=extra), changes, level)


def _adapt(calibration: Calibration, changes: Mapping[int, Change], level: Level) -> Calibration:
    autopilot, Q = calibration.extra.get(AUTOPILOT, {}), level.turn
    D, b_a = calibration.D, calibration.b_a
    change = changes.get(autopilot.get("imu"))
    if change is not None:
        A = change.mounting @ np.diag(change.new.scale / change.old.scale) @ change.mounting.T
        c = change.mounting @ (change.new.scale * (change.old.offset - change.new.offset))
        D, b_a = A @ D, A @ b_a + c
        values = change.slot.values(change.new)
        held = {**autopilot[OLD], **values}
        autopilot = {**autopilot, NEW: values, OLD: held, FIRST: {}, RESIDUAL_OLD: autopilot[RESIDUAL]}
    extra = {**calibration.extra, AUTOPILOT: autopilot} if autopilot else calibration.extra
    if "mounting" not in autopilot or np.array_equal(Q, np.eye(3)):
        return replace(calibration, D=D, b_a=b_a, extra=extra)
    names = {name: value for name, value in level.values().items() if name in autopilot[OLD]}
    turned = {**autopilot, OLD: {**autopilot[OLD], **names}, "mounting": (Q @ np.array(autopilot["mounting"])).tolist()}
    return replace(
        calibration,
        D=Q @ D @ Q.T,
        b_a=Q @ b_a,
        K=Q @ calibration.K @ Q.T,
        b_omega=Q @ calibration.b_omega,
        extra={**extra, AUTOPILOT: turned},
    )


def _is_writable(document: Mapping[str, Any]) -> bool:
    verdict = document.get("quality", {}).get("verdict", REFUSED)
    return verdict != REFUSED and bool(document.get(AUTOPILOT, {}).get(NEW))


def _change(autopilot: Mapping[str, Any], firmware: str) -> Change:
    imu = int(autopilot["imu"])
    if autopilot["firmware"] != firmware:
        raise WriteBackError(
            f"{NOTHING}: the calibration is of {autopilot['firmware']}, and this is {firmware}",
            "connect the vehicle that was calibrated",
        )
    slot = slot_of(firmware, imu, autopilot[NEW])
    new = None if slot is None else slot.correction(autopilot[NEW])
    old = None if slot is None else slot.correction(autopilot[OLD])
    if slot is None or new is None or old is None:
        why = autopilot.get("why", "it holds no new parameters")
        raise WriteBackError(f"{NOTHING}: the calibration does not fit the vehicle ({why})", "repeat the session")
    excess = slot.describe_excess(new)
    if excess is not None:
        raise WriteBackError(
            f"{NOTHING}: {excess}, which {firmware} accepts of its own calibration",
            "check that the vehicle was turned to every side, and the sensor",
        )
    degrees = autopilot.get(RESIDUAL_DEG)
    return Change(
        slot,
        slot.effective(old),
        new,
        np.array(autopilot["mounting"], float).reshape(3, 3),
        live_stream(str(autopilot["message"]), imu),
        autopilot[OLD].get(slot.sensor_id),
        float(autopilot[RESIDUAL]),
        autopilot.get(RESIDUAL_OLD),
        float(autopilot.get(UNCERTAIN) or 0.0),
        None if degrees is None else float(degrees),
    )
