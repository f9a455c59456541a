"""What new orientations say of a first calibration: whether they agree, and the likeliest reason where they do not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...calibration.verification import NewOrientation
from ...data import Recording
from ...reasons import Reason, reason
from ..events import Checked, Direction, Verification

AXES = "xyz"
# Below this a turn is too short to blame a scale on it.
LEAST_TURN_RAD = np.deg2rad(40.0)
WARMER_C = 8.0
MUCH_CLIPPED = 0.002


def judged(
    rests: Sequence[NewOrientation],
    new: Sequence[NewOrientation],
    of: int,
    recording: Recording,
    contradiction: Reason | None,
) -> Checked:
    """What is wrong, if anything is; where nothing is, but fewer than `of` are new, nothing is verified either.

    Parameters
    ----------
    rests : all since the fit. new : those of them that count. contradiction : what the pauses of the turning say
        against each other; None where they agree.
    """
    # one that was seen already verifies nothing, and may refute
    shown = [rest for rest in rests if any(rest is other for other in new) or not rest.agrees]
    found = tuple(_found(rest, i + 1, max(of, len(shown)), float(recording.t[-1])) for i, rest in enumerate(shown))
    against = _against(rests, shown, recording, contradiction)
    if against is None and rests and all(rest.clipped for rest in rests):
        return Checked(found, None, reason("verification_failed", "lost"))
    if against is None and len(new) < of:
        return Checked(found, None, reason("verification_failed", "too_few", number=len(new), of=of))
    return Checked(found, against is None, against)


def _against(
    rests: Sequence[NewOrientation], shown: Sequence[NewOrientation], recording: Recording, contradiction: Reason | None
) -> Reason | None:
    """The reason that explains most of what is wrong."""
    agree = all(rest.agrees for rest in shown)
    warmer = _warmer_c(recording)
    if abs(warmer) > WARMER_C:
        how = "rose" if warmer > 0 else "fell"
        if recording.sensor.message:
            return reason("temperature_moved", "of_vehicle_since_flat", how=how, change=abs(warmer))
        return reason("temperature_moved", "since_flat", how=how, change=abs(warmer))
    if rests and all(rest.clipped for rest in rests) and recording.gyr_clipped.any():
        return reason("gyro_clipped", "every_turn")
    if not agree and much_clipped(recording):
        return reason("gyro_clipped", "disagreement")
    if not rests:
        return reason("verification_failed", "never_still")
    if contradiction is not None:
        return explained(contradiction, recording)
    return None if agree else _why(shown, recording)


def explained(contradiction: Reason, recording: Recording) -> Reason:
    """A contradiction with its likeliest cause: a knock, where the accelerometer clipped."""
    if recording.acc_clipped.any():
        return reason("inconsistent", "knock", contradiction=contradiction.what)
    return contradiction


def much_clipped(recording: Recording) -> bool:
    """Whether turns beyond what the gyroscope can measure may explain whatever does not fit."""
    return bool(recording.gyr_clipped.mean() > MUCH_CLIPPED)


def _why(rests: Sequence[NewOrientation], recording: Recording) -> Reason:
    """What is most likely wrong with a sensor whose new orientations disagree."""
    lengths = [rest for rest in rests if not rest.magnitude_agrees]
    turns = [rest for rest in rests if not rest.direction_agrees]
    if turns and not lengths:
        scale = _scale_off(turns)
        if scale is not None:
            axis, share = scale
            return reason("verification_failed", "gyroscope", axis=axis, share=abs(share))
        worst = max(turns, key=lambda rest: rest.direction)
        miss, std = np.rad2deg([worst.direction, worst.direction_std])
        return reason("verification_failed", "direction", miss=miss, std=std)
    worst = max(lengths, key=lambda rest: abs(rest.magnitude))
    knock = " after a knock" if recording.acc_clipped.any() else ""
    return reason("verification_failed", "magnitude", error=worst.magnitude, knock=knock, std=worst.magnitude_std)


def _scale_off(rests: Sequence[NewOrientation]) -> tuple[str, float] | None:
    """The axis, and by which share every turn about it is wrong; None where the turns do not agree on one."""
    long = [rest for rest in rests if np.linalg.norm(rest.turn) > LEAST_TURN_RAD]
    if len(long) < 2:
        return None
    turn, miss = np.array([rest.turn for rest in long]), np.array([rest.miss for rest in long])
    axis = int(np.abs(turn).sum(0).argmax())
    share = float((turn[:, axis] @ miss[:, axis]) / (turn[:, axis] @ turn[:, axis]))
    left = miss - share * np.outer(turn[:, axis], np.eye(3)[axis])
    if abs(share) < 0.01 or np.linalg.norm(left) > 0.3 * np.linalg.norm(miss):
        return None
    return AXES[axis], share


def _warmer_c(recording: Recording) -> float:
    """C between the first and the last second."""
    known = recording.temperature_c[np.isfinite(recording.temperature_c)]
    n = max(round(recording.rate_hz), 1)
    return float(np.median(known[-n:]) - np.median(known[:n])) if len(known) > n else 0.0


def _found(rest: NewOrientation, number: int, of: int, t_s: float) -> Verification:
    x, y, z = rest.down.tolist()
    down: Direction = (x, y, z)
    known = f"1 sigma {np.rad2deg(rest.direction_std):.2f}"
    if rest.clipped:
        known = "not judged: on the way samples were lost or the gyroscope clipped"
    text = (
        f"new orientation {number} of {of}: |a| error {rest.magnitude:+.3f} m/s² (1 sigma {rest.magnitude_std:.3f}),"
        f" direction error {np.rad2deg(rest.direction):.2f} deg ({known})"
    )
    return Verification(
        t_s,
        number,
        of,
        down,
        rest.magnitude,
        rest.magnitude_std,
        float(np.rad2deg(rest.direction)),
        float(np.rad2deg(rest.direction_std)),
        rest.agrees,
        text,
    )
