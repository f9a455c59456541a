"""The inputs (events) and outputs (prompts, progress, decisions, requests) of a session, as frozen values."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from ..data import Samples, Sensor
from ..reasons import Reason

Direction = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class Key(StrEnum):
    """What the person can say."""

    ENOUGH = "enough"
    REDO = "redo"
    ABORT = "abort"


# What happens to a session.


@dataclass(frozen=True)
class Connected:
    """The sensor answered and measures."""

    sensor: Sensor


@dataclass(frozen=True)
class Measured:
    """Samples arrived; they carry the session's time."""

    samples: Samples


@dataclass(frozen=True)
class Tick:
    """The source was asked and the time is `t_s`, on the clock of the samples' times."""

    t_s: float


@dataclass(frozen=True)
class Enough:
    """The person says to go on now."""


@dataclass(frozen=True)
class Abort:
    """The person wants to stop."""


@dataclass(frozen=True)
class SourceEnded:
    """No more samples will come; `why` is None where a recording came to its end, else what failed."""

    why: str | None = None


@dataclass(frozen=True)
class Redo:
    """The person wants to turn the board again, without laying it flat again."""


@dataclass(frozen=True)
class Resumed:
    """A source that had ended goes on, `gap_s` later; nobody knows what the board did meanwhile."""

    gap_s: float


@dataclass(frozen=True)
class Learnt:
    """What is known by now, as it was asked for; with `advice` it says where to turn next."""

    knowledge: Knowledge
    advice: bool


@dataclass(frozen=True)
class Tried:
    """A first calibration from the turning alone, to be verified: its verdict, and the likeliest reason against it."""

    verdict: str
    reason: Reason | None = None


@dataclass(frozen=True)
class Checked:
    """What the new orientations say of the first calibration, and the reason where they do not agree.

    `agrees` is None where nothing was shown that says anything.
    """

    found: tuple[Verification, ...]
    agrees: bool | None
    reason: Reason | None = None


@dataclass(frozen=True)
class Fitted:
    """The final calibration is there, with its verdict: good, usable or refused."""

    verdict: str


@dataclass(frozen=True)
class Written:
    """The results are in their files."""

    names: tuple[str, ...]


# What the session itself finds in the above; they drive its table like the rest.


@dataclass(frozen=True)
class Rested:
    """The board lay still for long enough; `acc` [m/s^2] and `gyr` [rad/s] are the means meanwhile."""

    still_s: float
    acc: Direction
    gyr: Direction


@dataclass(frozen=True)
class Turned:
    """The board was turned enough, or as much as it will be: what follows verifies it."""

    why: str


@dataclass(frozen=True)
class Finished:
    """No more is to be measured: verified, or as well as it will be."""

    why: str


@dataclass(frozen=True)
class Stopped:
    """The session cannot go on or shall not; `why` says what happened, `remedy` what to do next."""

    why: str
    remedy: str


Event = (
    Connected
    | Measured
    | Tick
    | Enough
    | Redo
    | Abort
    | SourceEnded
    | Resumed
    | Learnt
    | Tried
    | Checked
    | Fitted
    | Written
    | Rested
    | Turned
    | Finished
    | Stopped
)


# What the session answers.


class PromptKind(StrEnum):
    """What the person (or the hand that stands in for one) is to do now."""

    LAY_FLAT = "lay_flat"
    ROTATE = "rotate"
    VERIFY = "verify"
    AGAIN = "again"
    REST = "rest"


@dataclass(frozen=True)
class Prompt:
    """An instruction to the person: the one that holds until the next.

    Attributes
    ----------
    kind : what to do. text : the same in words.
    down : unit vector in the board's axes that is to point down, where one orientation is wanted.
    """

    kind: PromptKind
    text: str
    down: Direction | None = None


@dataclass(frozen=True)
class Progress:
    """How far the present step is: `done` of `of`, in words; `t_s` is the session's time."""

    t_s: float
    done: float
    of: float
    text: str


@dataclass(frozen=True)
class Meter:
    """What the board does this moment, four times a second: for a needle and a picture, not for words.

    Attributes
    ----------
    level : 0 perfectly still, 1 at the limit of what counts as still, beyond it moving. still : below that limit.
    what : what moves it most, in words; empty where it is still.
    down : unit vector in the board's axes that points down now. turning_dps : how fast it turns [deg/s].
    rate_hz : samples a second as they come. temperature_c : of the chip; None where it says none.
    attitude : unit quaternion (w, x, y, z) that takes the board's axes to the room's: x right, y away, z up, as the
        board lay flat before whoever holds it.
    missing_deg : what is missing to the wanted orientation [deg]. turn : the way there in words, such as "60 deg more,
        roll it to the left"; empty where nothing is missing. wanted : the attitude that it leads to. None, empty and
        None where no orientation is wanted.
    """

    t_s: float
    level: float
    still: bool
    what: str
    down: Direction
    turning_dps: float
    rate_hz: float
    temperature_c: float | None
    attitude: Quaternion = (1.0, 0.0, 0.0, 0.0)
    missing_deg: float | None = None
    turn: str = ""
    wanted: Quaternion | None = None


@dataclass(frozen=True)
class Countdown:
    """How long the board must stay still yet, while something waits for that; `paused` by a bump.

    It starts over (`remaining_s` is `of_s` again) only where the board was moved. `elsewhere`: not in the wanted
    orientation, but in another one that is new and useful.
    """

    t_s: float
    remaining_s: float
    of_s: float
    paused: bool
    elsewhere: bool = False


class Use(StrEnum):
    """Of what use an orientation was that was held."""

    TAKEN = "taken"
    USEFUL = "useful"
    SEEN = "seen"


@dataclass(frozen=True)
class Held:
    """The board was held for long enough: in the wanted orientation, in another new one, or in one seen before.

    Attributes
    ----------
    down : unit vector in the board's axes that pointed down. text : the use in words.
    """

    t_s: float
    use: Use
    down: Direction
    text: str


@dataclass(frozen=True)
class Caution:
    """Something is not as it should be: `what` in one line, and what to `do` about it now.

    `code` names its kind for those who count them: moved, trembling, too_fast, clipped, data_lost, not_turned,
    seen_already, doubtful, knocked, refused; of a stream accelerometer_contradicted, gyroscope_contradicted.
    """

    t_s: float
    code: str
    what: str
    do: str


@dataclass(frozen=True)
class Seen:
    """The board has shown one more orientation: number `number` (the flat one is the first).

    Attributes
    ----------
    down : unit vector in the board's axes that pointed down. paused : it was held; else only passed in turning.
    """

    t_s: float
    number: int
    down: Direction
    paused: bool


@dataclass(frozen=True)
class Target:
    """Standard uncertainties (1 sigma) to reach: of scale factor error, misalignment and bias."""

    gain_pct: float
    misalignment_deg: float
    bias_mg: float


@dataclass(frozen=True)
class Knowledge:
    """Standard uncertainties of the accelerometer's parameters so far, about once a second while the board is turned.

    Attributes
    ----------
    gain_pct, misalignment_deg, bias_mg : (x, y, z) standard uncertainties (1 sigma) of the scale factor error [%], the
        misalignment [deg] (of an axis' two the larger) and the bias [mg]. 1e3 or so: not observable yet.
    target : what is wanted of each.
    gain, misalignment, bias : (x, y, z) progress toward it, 0..1. overall : the least of all nine.
    down : unit vector in the board's axes: the still orientation that would help most if it pointed down now.
        None where every one has reached its target.
    words : the largest uncertainty of each kind, in words.
    doubt : one line where the data contradict each other already (a flipped axis, a wrong range), else empty.
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


@dataclass(frozen=True)
class Verification:
    """The check of a calibration in one orientation that its fit had not seen.

    Attributes
    ----------
    number, of : which one of how many. down : unit vector in the board's axes that pointed down.
    magnitude_mps2, magnitude_std_mps2 : |a| - g there, and its predicted standard uncertainty.
    direction_deg, direction_std_deg : angle between gravity as predicted by the gyroscope and as measured, and its
        predicted standard uncertainty.
    agrees : both are within four of these. text : the same in words.
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


@dataclass(frozen=True)
class Decision:
    """The session went on to its next state, or ended: `why`, and where it ended early, what to do next."""

    why: str
    remedy: str = ""


class Wish(StrEnum):
    """What can be asked of whoever computes."""

    KNOW = "know"
    ADVISE = "advise"
    TRY = "try"
    CHECK = "check"


@dataclass(frozen=True)
class Ask:
    """To the session's owner: compute this of all samples so far, and bring it after `wait_s` seconds of samples more.

    Always after the same number of samples, waited for if need be: so a replay equals its session.
    KNOW and ADVISE bring Learnt, TRY brings Tried, CHECK brings Checked of the samples after the TRY.
    """

    wish: Wish
    wait_s: float


@dataclass(frozen=True)
class Forget:
    """To the session's owner: samples number first..last-1 are not to be used; what follows them follows a gap."""

    first: int
    last: int


Command = Ask | Forget
Output = Prompt | Progress | Meter | Countdown | Held | Caution | Seen | Knowledge | Verification | Decision | Command
