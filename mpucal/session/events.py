"""The inputs (events) and outputs (prompts, progress, decisions, requests) of a session, as frozen values."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple

import numpy as np

from ..data import Samples, Sensor, Vector
from ..reasons import Reason

Direction = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
LAID: Quaternion = (1.0, 0.0, 0.0, 0.0)  # attitude of a board that lies face up


def triple(v: Vector) -> Direction:
    """Return an array (3,) as the plain floats that an event carries."""
    x, y, z = np.asarray(v, float).tolist()
    return x, y, z


def down_of(acc: Vector) -> Direction:
    """Return the unit vector that points down in the board's axes, from an acceleration (3,) at rest."""
    return triple(-acc / max(float(np.linalg.norm(acc)), 1e-9))


class Key(StrEnum):
    """Keys that a person can press, by their meaning."""

    ENOUGH = "enough"
    REDO = "redo"
    ABORT = "abort"


# Events from outside: the source, the person and the fits.


class Connected(NamedTuple):
    """The sensor answered and measures."""

    sensor: Sensor


class Measured(NamedTuple):
    """Samples arrived; they carry the session's time."""

    samples: Samples


class Tick(NamedTuple):
    """The source was polled at `t_s`, on the clock of the samples' times."""

    t_s: float


class Enough(NamedTuple):
    """The person says to go on now."""


class Abort(NamedTuple):
    """The person wants to stop."""


class SourceEnded(NamedTuple):
    """The source delivers no more samples: `why` is what failed, or None at the end of a recording."""

    why: str | None = None


class Redo(NamedTuple):
    """The person wants to turn the board again, without laying it flat again."""


class Resumed(NamedTuple):
    """The source resumed; the board's motion in between is unknown."""


class Learnt(NamedTuple):
    """The uncertainties were computed, as requested; with `advice`, also the orientation that helps most."""

    knowledge: Knowledge
    advice: bool


class Tried(NamedTuple):
    """The first calibration, from the turning alone, was computed: its verdict, and the likeliest reason against it."""

    verdict: str
    reason: Reason | None = None


class Checked(NamedTuple):
    """The first calibration was compared with the new orientations.

    Attributes
    ----------
    verifications : one for each orientation. agrees : None where the orientations show too little to decide.
    reason : the likeliest cause, where they do not agree or do not decide.
    doubtful : True if one more orientation may decide it, after a new first calibration that uses these orientations.
    """

    verifications: tuple[Verification, ...]
    agrees: bool | None
    reason: Reason | None = None
    doubtful: bool = False


Answer = Learnt | Tried | Checked


class Fitted(NamedTuple):
    """The final calibration was computed; its verdict is good, usable or refused."""

    verdict: str


class Written(NamedTuple):
    """The results are in their files."""

    names: tuple[str, ...]


class Rested(NamedTuple):
    """The board lay still for long enough; `acc` [m/s^2] and `gyr` [rad/s] are the means meanwhile."""

    still_s: float
    acc: Direction
    gyr: Direction


class Turned(NamedTuple):
    """The turning has ended; the verification follows."""

    why: str


class Finished(NamedTuple):
    """The measuring has ended; the final calibration follows."""

    why: str


class Stopped(NamedTuple):
    """The session cannot go on; `why` says what happened, `remedy` what to do next."""

    why: str
    remedy: str


# Events that a step derives from the samples, and that end it.
End = Rested | Turned | Finished | Stopped
Event = Connected | Measured | Tick | Enough | Abort | SourceEnded | Redo | Resumed | Answer | Fitted | Written | End

# Outputs.


class PromptKind(StrEnum):
    """Actions that the person, or a simulated hand, is asked for."""

    LAY_FLAT = "lay_flat"
    ROTATE = "rotate"
    VERIFY = "verify"
    AGAIN = "again"
    REST = "rest"


class Prompt(NamedTuple):
    """An instruction to the person, valid until the next one.

    Attributes
    ----------
    kind : what to do. text : the instruction.
    down : unit vector in the board's axes that is to point down, where one orientation is wanted.
    """

    kind: PromptKind
    text: str
    down: Direction | None = None


class Progress(NamedTuple):
    """Progress of the present step: `done` of `of`, and as text; `t_s` is the session's time.

    left_s : estimate of the time until the verification ends; None where it is unknown.
    """

    t_s: float
    done: float
    of: float
    text: str
    left_s: float | None = None


class Meter(NamedTuple):
    """The board's motion at this moment, four times a second, for the picture and the needle.

    Attributes
    ----------
    level : 0 perfectly still, 1 at the limit of what counts as still, beyond it moving. still : below that limit.
    what : the largest motion, as text; empty while the board is still.
    down : unit vector in the board's axes that points down now. turning_dps : rate of turning [deg/s].
    rate_hz : samples a second as they arrive. temperature_c : of the chip; None where it has no thermometer.
    attitude : unit quaternion (w, x, y, z) that takes the board's axes to the room's: x right, y away, z up, as the
        board lay flat before its operator.
    missing_deg : angle to the wanted orientation [deg]. turn : the turn there as text, such as "60 deg more, roll it
        to the left"; empty where nothing is missing. wanted : the attitude that it leads to. None, empty and None
        where no orientation is wanted.
    """

    t_s: float
    level: float
    still: bool
    what: str
    down: Direction
    turning_dps: float
    rate_hz: float
    temperature_c: float | None
    attitude: Quaternion = LAID
    missing_deg: float | None = None
    turn: str = ""
    wanted: Quaternion | None = None


class Countdown(NamedTuple):
    """Time for which the board must still be held; `paused` while a bump disturbs it.

    It starts over (`remaining_s` is `of_s` again) only if the board was moved. `elsewhere`: the board is not in the
    wanted orientation, but in another one that is new and useful.
    """

    t_s: float
    remaining_s: float
    of_s: float
    paused: bool
    elsewhere: bool = False


class Use(StrEnum):
    """Use of an orientation that was held: the wanted one, another new one, or one seen before."""

    TAKEN = "taken"
    USEFUL = "useful"
    SEEN = "seen"


class Held(NamedTuple):
    """The board was held for long enough in one orientation.

    Attributes
    ----------
    down : unit vector in the board's axes that pointed down. text : the use, as text.
    """

    t_s: float
    use: Use
    down: Direction
    text: str


class Caution(NamedTuple):
    """A warning: `what` is wrong, and what to `do` about it now, one line each.

    `code` is its kind: moved, trembling, too_fast, clipped, data_lost, not_turned, seen_already, doubtful, knocked,
    refused; in `mpucal stream` also accelerometer_contradicted and gyroscope_contradicted.
    """

    t_s: float
    code: str
    what: str
    do: str


class Seen(NamedTuple):
    """The board has shown a new orientation, number `number`; the flat one is number 1.

    Attributes
    ----------
    down : unit vector in the board's axes that pointed down. paused : True if it was held, not only passed.
    """

    t_s: float
    number: int
    down: Direction
    paused: bool


class Target(NamedTuple):
    """Standard uncertainties (1 sigma) to reach: of scale factor error, misalignment and bias."""

    gain_pct: float
    misalignment_deg: float
    bias_mg: float


class Knowledge(NamedTuple):
    """Standard uncertainties of the accelerometer's parameters so far.

    They are computed after each new orientation, and every five seconds without one.

    Attributes
    ----------
    gain_pct, misalignment_deg, bias_mg : (x, y, z) standard uncertainties (1 sigma) of the scale factor error [%], the
        misalignment [deg] (the larger one of an axis' two) and the bias [mg]. About 1e3: not observable yet.
    target : the target of each.
    gain, misalignment, bias : (x, y, z) progress towards the target, 0..1. overall : the least of these nine.
    down : unit vector in the board's axes: the orientation at rest that would reduce the uncertainty most.
        None where it was not requested.
    words : the largest uncertainty of each kind, as text.
    doubt : one line if no sound sensor has such parameters (a flipped axis, a wrong range), else empty.
    """

    t_s: float
    gain_pct: Direction
    misalignment_deg: Direction
    bias_mg: Direction
    target: Target
    gain: Direction
    misalignment: Direction
    bias: Direction
    overall: float
    down: Direction | None
    words: str
    doubt: str = ""


class Verification(NamedTuple):
    """The check of a calibration in one orientation that its fit had not seen.

    Attributes
    ----------
    number, of : its number, and how many there are. down : unit vector in the board's axes that pointed down.
    magnitude_mps2, magnitude_std_mps2 : |a| - g there, and its predicted standard uncertainty.
    direction_deg, direction_std_deg : angle between gravity as predicted by the gyroscope and as measured, and its
        predicted standard uncertainty.
    agrees : True if both are within four predicted standard uncertainties of 0. text : the result, as text.
    """

    t_s: float
    number: int
    of: int
    down: Direction
    magnitude_mps2: float
    magnitude_std_mps2: float
    direction_deg: float
    direction_std_deg: float
    agrees: bool
    text: str


class Decision(NamedTuple):
    """The session went to its next state, or ended: `why`, and what to do next if it ended early."""

    why: str
    remedy: str = ""


class FitKind(StrEnum):
    """Fits that a session can request."""

    KNOW = "know"
    ADVISE = "advise"
    TRY = "try"
    CHECK = "check"


class RequestFit(NamedTuple):
    """Command to the session's owner: compute this fit of all samples so far, and answer `wait_s` of samples later.

    The answer always comes after the same number of samples, and is waited for if necessary, so that a replay equals
    its session. KNOW and ADVISE are answered by Learnt, TRY by Tried, and CHECK by Checked. CHECK compares the samples
    since the TRY, which must show `of` new orientations.
    """

    kind: FitKind
    wait_s: float
    of: int = 0


class Forget(NamedTuple):
    """Command to the session's owner: drop samples number first..last-1, and mark a gap before the next one."""

    first: int
    last: int


Command = RequestFit | Forget
Output = Prompt | Progress | Meter | Countdown | Held | Caution | Seen | Knowledge | Verification | Decision | Command
# Outputs of a step; an event that ends the step comes last.
Outputs = list[Output | End]
