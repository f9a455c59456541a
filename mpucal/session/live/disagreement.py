"""What unseen rests say of a first calibration, in words with a remedy. Knows no filter."""

from __future__ import annotations

import numpy as np

from ...calibration.verification import Rest
from ...data import Recording
from ..events import Checked, Direction, Verification

AXES = "xyz"
# Below this a turn is too short to blame a scale on it.
LEAST_TURN_RAD = np.deg2rad(40.0)
WARMER_C = 8.0
MUCH_CLIPPED = 0.002
CLIPPED = "turn the board more slowly, or choose a larger --gyro-range, and run the session again"


def judged(rests: list[Rest], of: int, recording: Recording, contradiction: str) -> Checked:
    """All of them, and what is wrong, if anything is.

    contradiction : what the rests of the turning say against each other; empty where they agree.
    """
    found = tuple(_found(rest, i + 1, max(of, len(rests)), float(recording.t[-1])) for i, rest in enumerate(rests))
    warmer = _warmer_c(recording)
    if abs(warmer) > WARMER_C:
        how = "rose" if warmer > 0 else "fell"
        return Checked(
            found,
            False,
            "temperature_moved",
            f"the chip's temperature {how} by {abs(warmer):.0f} C since the board lay flat, and its biases with it",
            "let the board warm up for ten minutes, away from the sun and from draughts, and run the session again",
        )
    if rests and all(rest.clipped for rest in rests):
        what = "every turn went beyond what the gyroscope can measure, so nothing says where gravity went"
        return Checked(found, False, "gyro_clipped", what, CLIPPED)
    if not all(result.agrees for result in found) and much_clipped(recording):
        what = "the new orientations disagree, after turns beyond what the gyroscope can measure"
        return Checked(found, False, "gyro_clipped", what, CLIPPED)
    if not rests:
        what = "the board was never still in a new orientation, so nothing verifies the calibration"
        return Checked(found, False, "verification_failed", what, "run the session again, and hold the board still")
    if contradiction:
        return Checked(found, False, "inconsistent", *explained(contradiction, recording))
    if all(result.agrees for result in found):
        return Checked(found, True)
    return Checked(found, False, "verification_failed", *_why(rests, recording))


def explained(contradiction: str, recording: Recording) -> tuple[str, str]:
    """What contradicts itself, and what to do, by the message of that reason; a knock is the likeliest cause."""
    what, _, remedy = contradiction.partition("; ")
    if recording.acc_clipped.any():
        return (
            f"something knocked the board (the accelerometer stood at the end of its range), and {what}",
            "let nothing knock it, fasten the sensor, and run the session again",
        )
    return what, remedy


def much_clipped(recording: Recording) -> bool:
    """Whether turns beyond what the gyroscope can measure may explain whatever does not fit."""
    return bool(recording.gyr_clipped.mean() > MUCH_CLIPPED)


def _why(rests: list[Rest], recording: Recording) -> tuple[str, str]:
    """What is most likely wrong, and what to do."""
    lengths = [rest for rest in rests if not rest.magnitude_agrees]
    turns = [rest for rest in rests if not rest.direction_agrees]
    if turns and not lengths:
        scale = _scale_off(turns)
        if scale is not None:
            axis, share = scale
            return (
                f"your gyroscope's scale about {axis} is off by {abs(share):.0%} against the turning before",
                "give the gyroscope's true range and rate, turn more slowly, and run the session again",
            )
        worst = max(turns, key=lambda rest: rest.direction)
        return (
            f"gravity, carried by the gyroscope to a new orientation, misses the accelerometer by"
            f" {np.rad2deg(worst.direction):.1f} deg, and {np.rad2deg(worst.direction_std):.1f} deg was promised:"
            " the sensor moved on its mount",
            "fasten the sensor to its board, and run the session again",
        )
    worst = max(lengths, key=lambda rest: abs(rest.magnitude))
    knock = " after a knock" if recording.acc_clipped.any() else ""
    return (
        f"in a new orientation |a| is {worst.magnitude:+.3f} m/s² off{knock}, and {worst.magnitude_std:.3f} m/s² was"
        f" promised: the accelerometer changed, or slipped on its mount, while it was turned",
        "fasten the sensor, let nothing press on, knock or warm it, and run the session again",
    )


def _scale_off(rests: list[Rest]) -> tuple[str, float] | None:
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


def _found(rest: Rest, number: int, of: int, t_s: float) -> Verification:
    agrees = rest.magnitude_agrees and rest.direction_agrees
    x, y, z = rest.down.tolist()
    down: Direction = (x, y, z)
    text = (
        f"new orientation {number} of {of}: |a| off by {rest.magnitude:+.3f} m/s² (promised {rest.magnitude_std:.3f}),"
        f" direction by {np.rad2deg(rest.direction):.2f} deg (promised {np.rad2deg(rest.direction_std):.2f})"
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
        agrees,
        text,
    )
