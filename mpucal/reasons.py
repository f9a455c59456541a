"""The reasons against a calibration: a row for each reason code, with its sentences and their remedies.

A check (calibration/checks/, session/live/verification.py) decides whether a reason holds, and fills its numbers into
one of the row's sentences: `reason("gyro_clipped", "samples", refuse=False, count=12, share=0.01)`. A new reason is a
row here and a check there. `python -m tools.make pages` makes docs/reasons.md from this table.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, Required, TypedDict

from .origin import Origin, name_thing

if TYPE_CHECKING:
    # part of every type checker; result/keys.py takes it from here
    from typing_extensions import ReadOnly as ReadOnly  # noqa: PLC0414
else:

    class ReadOnly:
        """Stand-in for typing.ReadOnly of Python 3.13: the type itself."""

        def __class_getitem__(cls, kind: Any) -> Any:
            return kind


class ReasonFound(TypedDict, total=False):
    """Entry of quality.reasons in calibration.json."""

    code: Required[ReadOnly[Annotated[str, {"pattern": "^[a-z0-9_]{1,64}$"}]]]
    message: Required[ReadOnly[Annotated[str, "what is wrong, and what to do"]]]
    remedy: ReadOnly[Annotated[str, "what to do"]]


@dataclass(frozen=True)
class Reason:
    """Reason against a calibration.

    Attributes
    ----------
    code : key of KINDS. what, remedy : a clause each: what is wrong, what to do. refuse : the calibration is refused.
    """

    code: str
    what: str
    remedy: str
    refuse: bool

    def __post_init__(self) -> None:
        if self.code not in KINDS:
            raise ValueError(f"there is no reason {self.code!r} in mpucal/reasons.py")

    @property
    def message(self) -> str:
        """Return both clauses as one sentence, without its full stop."""
        return f"{self.what}; {self.remedy}"

    def about(self, origin: Origin) -> Reason:
        """Return the reason in the words for samples of `origin`."""
        return replace(self, what=name_thing(self.what, origin), remedy=name_thing(self.remedy, origin))

    def document(self) -> ReasonFound:
        """Return the entry of quality.reasons in calibration.json."""
        return {"code": self.code, "message": self.message, "remedy": self.remedy}


@dataclass(frozen=True)
class Sentence:
    """Sentence of a reason, with {places} for numbers; `refuse` is None if the check decides."""

    what: str
    remedy: str
    refuse: bool | None = None


@dataclass(frozen=True)
class Kind:
    """Kind of reasons, with one code.

    Attributes
    ----------
    meaning : what is wrong, for the documentation. sentences : by the name that a check gives.
    reproduce : a way to see it: a `mpucal session` on the simulated chip, or Python that calibrates a spoilt copy of r,
        the recording of a good session.
    refused_when : condition of a refusal, if it depends. turn_again : turning the board again from the start may help.
    of_the_sensor : it may be the cause of a contradiction in the data.
    """

    meaning: str
    sentences: Mapping[str, Sentence]
    reproduce: str
    refused_when: str = ""
    turn_again: bool = False
    of_the_sensor: bool = False

    @property
    def refuses(self) -> str:
        """Return "always", "never" or "depends"."""
        refusals = {sentence.refuse for sentence in self.sentences.values()}
        if len(refusals) > 1 or None in refusals:
            return "depends"
        return "always" if True in refusals else "never"


def reason(code: str, sentence: str, refuse: bool | None = None, **numbers: object) -> Reason:
    """Return a reason, with `numbers` in the places of its sentence.

    Raises
    ------
    KeyError : unknown code, sentence or place. ValueError : `refuse` is given although the table decides, or missing.
    """
    row = KINDS[code].sentences[sentence]
    if (refuse is None) == (row.refuse is None):
        raise ValueError(f"{code}, {sentence}: either the table or the check decides on a refusal, not both")
    decided = bool(refuse if row.refuse is None else row.refuse)
    return Reason(code, row.what.format(**numbers), row.remedy.format(**numbers), decided)


# after a reason against the gyroscope, where an estimate is possible without it
OF_RESTS = ": D and b_a are estimated from the rests alone, in the accelerometer's own axes"

_LAY_IT_DOWN = "lay it on a table for ten seconds before you turn it"
_SLOWER = "turn more slowly, or choose a larger --gyro-range"

RAW = "record the raw accelerometer; on Android that is TYPE_ACCELEROMETER, on iOS CMAccelerometerData"
WARM_VEHICLE = (
    "leave the vehicle switched on until its IMU is warm, then measure again: an autopilot that heats it (to"
    " BRD_HEAT_TARG of ArduPilot, SENS_IMU_TEMP of PX4) takes some minutes"
)

KINDS: Mapping[str, Kind] = {
    "never_still": Kind(
        "The board did not lie still before it was turned, so the gyroscope's bias and the noise are not known.",
        {
            "at_all": Sentence(
                "the board never lay still for a second, so the gyroscope's bias and the noise are not known",
                _LAY_IT_DOWN,
                True,
            ),
            "late": Sentence(
                "the board lay still only after {seconds:.0f} s, when its turns were over", _LAY_IT_DOWN, True
            ),
            "short": Sentence(
                "the flat segment that was given, samples {first} to {last}, is too short to tell the gyroscope's bias"
                " and the noise",
                "give a second or more of it, or leave it out, and it is looked for",
                True,
            ),
        },
        "mpucal.calibrate(replace(r, acc=r.acc[::-1], gyr=-r.gyr[::-1]))",
    ),
    "few_orientations": Kind(
        "Some directions of acceleration are not observable, or known too little: the board was not held in enough"
        " orientations that differ.",
        {
            "hardly_turned": Sentence(
                "the board was hardly turned (gravity moved {degrees:.0f} deg in all, in {samples} samples after it lay"
                " flat)",
                "turn it so that each of its sides, edges and corners points down once",
                True,
            ),
            "nothing_known": Sentence(
                "no direction can be calibrated from this recording",
                "check that the accelerometer follows the board throughout, and hold the board still in ten"
                " orientations that differ",
                True,
            ),
            "uncertain": Sentence(
                "a calibrated reading is known to {rms:.2g} m/s^2 (1 sigma) only, least certain with {side} up",
                "hold the board still in more orientations: {side} up, {side} down, and tilted",
            ),
            "not_observable": Sentence(
                "not every direction is observable from this recording, least of all with {side} up",
                "hold the board still in more orientations: {side} up, {side} down, and tilted",
                True,
            ),
            "tilted": Sentence(
                "the board was only tilted: the calibration holds within {degrees:.0f} deg of how it lay flat{left}",
                "turn it upside down to observe the rest",
                False,
            ),
        },
        "mpucal session --bus sim:hand=still --seed 1",
        "the error of a calibrated reading is above 0.4 m/s² (1 sigma) or not known",
        turn_again=True,
    ),
    "gyro_clipped": Kind(
        "The board was turned faster than the gyroscope's range can measure, so the angle of that turn is not known.",
        {
            "samples": Sentence(
                "the gyroscope was at the end of its range in {count} samples ({share:.1%})",
                "turn more slowly, or choose a larger range",
            ),
            "contradicts": Sentence(
                "after turns beyond the gyroscope's range, gravity ends {degrees:.0f} degrees from where they lead it",
                f"{_SLOWER}, and measure again",
                True,
            ),
            "every_turn": Sentence(
                "every turn went beyond the gyroscope's range, so nothing says where gravity went",
                f"{_SLOWER}, and measure again",
                True,
            ),
            "disagreement": Sentence(
                "the new orientations disagree, after turns beyond the gyroscope's range",
                f"{_SLOWER}, and measure again",
                True,
            ),
        },
        "mpucal session --bus sim:hand=hasty --gyro-range 250 --seed 2",
        "more than 20 % of the samples are clipped, or the new orientations cannot be verified because of it",
        turn_again=True,
    ),
    "accel_clipped": Kind(
        "The accelerometer reached the end of its range: a knock, or a range that is too small.",
        {
            "samples": Sentence(
                "the accelerometer was at the end of its range in {count} samples ({share:.1%})",
                "move more gently, or choose a larger range",
            ),
        },
        "mpucal session --bus sim:hand=knocking --seed 1",
        "more than 20 % of the samples are clipped",
        turn_again=True,
    ),
    "data_lost": Kind(
        "Samples are missing or stuck: the bus or the link was too slow or failed, or the session was interrupted.",
        {
            "bus": Sentence(
                "samples are missing or stuck in {places} ({seconds:.2f} s in all)",
                "unless the measurement was interrupted there, use a faster bus or a lower rate",
            ),
            "link": Sentence(
                "samples are missing or stuck in {places} ({seconds:.2f} s in all)",
                "unless the measurement was interrupted there, use a nearer or faster link or a lower rate",
            ),
            "file": Sentence(
                "samples are missing or stuck in {places} ({seconds:.2f} s in all)",
                "unless the recording was interrupted there, let what records it keep up: a lower rate, or no other"
                " programs beside it",
            ),
        },
        "mpucal session --bus sim:fault=overflow@30 --seed 1",
        "more than half of the recording is missing, not counting interruptions of more than 10 s",
        turn_again=True,
    ),
    "left_handed": Kind(
        "Axes of the accelerometer have the opposite sign of the gyroscope's.",
        {
            "axes": Sentence(
                "the accelerometer's axes are left-handed against the gyroscope's",
                "change the sign of its {axes}, or of its {others} where the board did not lie face up",
                True,
            ),
        },
        "mpucal session --bus sim:D=1/0/0/0/-1/0/0/0/1 --seed 1",
        of_the_sensor=True,
    ),
    "swapped_axes": Kind(
        "The accelerometer's axes are named in another order, or with other signs, than the gyroscope's.",
        {
            "axes": Sentence(
                "the accelerometer's axes x, y, z lie along the gyroscope's {order}",
                "name them so that both agree",
                True,
            ),
        },
        "mpucal session --bus sim:D=0/1/0/1/0/0/0/0/-1 --seed 1",
        of_the_sensor=True,
    ),
    "clock_off": Kind(
        "The clock that the samples' times come from, a bridge's, is off against the host's, or its rate is not known;"
        " or accelerometer and gyroscope were not measured at the same times.",
        {
            "corrected": Sentence(
                "the bridge's clock runs {ppm:+.0f} ppm against this computer's (1 sigma {std:.0f}), and all times were"
                " corrected for that",
                "nothing has to be done; a board with a quartz crystal is within 100 ppm",
                False,
            ),
            "unknown": Sentence(
                "the rate of the bridge's clock is known to {std:.0f} ppm (1 sigma) only, and the gyroscope's scale"
                " factors no better",
                "record for a minute or more, through a port that is not shared",
                False,
            ),
            "trusted": Sentence(
                "the rate of the bridge's clock is known to {std:.0f} ppm (1 sigma) only, and the model {model} takes"
                " the gyroscope's scale factors to be exact: D and b_a may have larger errors than their uncertainties"
                " say",
                "use --model hand, which estimates them",
                False,
            ),
            "apart": Sentence(
                "the accelerometer {how} the gyroscope by {lag:.0f} ms, more than filters leave: they have not the same"
                " times",
                "record each sensor with times of its own; D and b_a are corrected for it, and calibrated samples are"
                " not",
                False,
            ),
        },
        "mpucal.calibrate(replace(r, sensor=replace(r.sensor, clock_ppm=5000.0, clock_std=2e-5)))",
    ),
    "wrong_range": Kind(
        "The accelerometer was set to another full-scale range than the one that its counts were converted with.",
        {
            "power_of_two": Sentence(
                "all three scale factors are near {factor:g}: the accelerometer's range is not the one assumed (or it"
                " is an early revision with half the sensitivity)",
                "give the true range",
                True,
            ),
        },
        "mpucal session --bus sim:D=2/0/0/0/2/0/0/0/2 --seed 1",
        of_the_sensor=True,
    ),
    "units_suspect": Kind(
        "Times, accelerations or rates seem to be in another unit than s, m/s² and rad/s.",
        {
            "times": Sentence(
                "the samples are {step:.4g} s apart, too far to follow a turn: their times seem to be in {unit}seconds",
                "convert them to seconds, or say --units t={said}",
                True,
            ),
            "slow": Sentence(
                "the samples are {step:.3g} s apart ({rate:.2g} Hz), too far to follow a turn",
                "record at 50 Hz or more, or say --units t=UNIT if the times are no seconds",
                True,
            ),
            "accelerometer": Sentence(
                "the accelerometer's median magnitude is {magnitude:.4g}, not near {gravity:.4g} m/s^2: it seems to be"
                " in {unit}",
                "convert it to m/s^2, or say --units acc={said}",
                True,
            ),
            "scale_factors": Sentence(
                "all three scale factors are near {factor:.3g}, and no accelerometer has such an error: it seems to be"
                " in another unit than m/s^2",
                "convert it to m/s^2, or say --units acc=UNIT",
                True,
            ),
            "alike": Sentence(
                "all three scale factors are near {factor:.3g}, and data sheets allow 3 %: range, unit or gravity seem"
                " not to be those assumed",
                "check them; D holds for samples in the same unit and range",
                False,
            ),
            "gyroscope": Sentence(
                "the gyroscope reads up to {rate:.4g}, which as rad/s is {degrees:.0f} deg/s and does not fit how"
                " gravity turned: it seems to be in {unit}",
                "convert it to rad/s, or say --units gyr={said}",
                True,
            ),
        },
        "mpucal.calibrate(replace(r, acc=r.acc / 9.80665))",
        "the unit is wrong by far; if all scale factors err alike by 10 % or more, they are estimated, and the"
        " calibration is usable",
    ),
    "moved_while_still": Kind(
        "The board moved in the segment in which it was said to lie flat.",
        {
            "mean": Sentence(
                "the board moved while it should have lain flat ({axis} changed by {moved:.2g} m/s^2)",
                "lay it down, take the hands off, and wait for ten seconds",
                True,
            ),
        },
        "mpucal.calibrate(replace(r, flat=(0, len(r) // 2)))",
    ),
    "gyro_off": Kind(
        "The gyroscope's scale factors are beyond its data sheet, or it did not measure at all.",
        {
            "missing": Sentence(
                "the recording holds the accelerometer alone, as a chip measures at 4000 Hz, and nothing says how the"
                " board was turned",
                "record it at 1000 Hz or less",
                True,
            ),
            "constant": Sentence(
                "the gyroscope reads the same on {axes} in every sample, though the board was turned: it is broken or"
                " was not recorded",
                "check its wiring and the recording",
                True,
            ),
            "range": Sentence(
                "gravity turns {factor:g} times as far as the gyroscope says: it seems to have another range than"
                " assumed{ranges}",
                "say --gyro-range, or multiply its rates by {factor:g}",
                True,
            ),
            "contradicts": Sentence(
                "from rest to rest gravity ends {degrees:.0f} degrees from where the gyroscope's rates lead it",
                "check the gyroscope's axes, unit, range and times, and that the turns between the rests are recorded",
                True,
            ),
            "scale": Sentence(
                "the gyroscope's scale factor error is {scale:.1%} on {axis} and its cross-axis sensitivity"
                " {cross:.1%}, more than its data sheet allows",
                "check its range and the sample rate",
                False,
            ),
        },
        "mpucal.calibrate(replace(r, gyr=1.1 * r.gyr))",
        "the gyroscope did not measure or contradicts the rests, and the rests alone are not enough",
    ),
    "temperature_moved": Kind(
        "The chip warmed or cooled while it was measured, and its biases moved with it.",
        {
            "range": Sentence(
                "the temperature moved from {low:.1f} to {high:.1f} C, and the biases with it",
                "let the board warm up first",
                False,
            ),
            "since_flat": Sentence(
                "the chip's temperature {how} by {change:.0f} C since the board lay flat, and its biases with it",
                "let the board warm up for ten minutes, away from the sun and from draughts, and measure again",
                True,
            ),
            "of_vehicle": Sentence(
                "the temperature moved from {low:.1f} to {high:.1f} C, and the biases with it",
                WARM_VEHICLE,
                False,
            ),
            "of_vehicle_since_flat": Sentence(
                "the IMU's temperature {how} by {change:.0f} C since the vehicle lay flat, and its biases with it",
                WARM_VEHICLE,
                True,
            ),
        },
        "mpucal session --bus sim:hand=warming --seed 1",
        "the temperature changed by more than 8 °C between laying flat and the verification",
    ),
    "not_raw": Kind(
        "The accelerations were computed by a fusion filter: they are not what an accelerometer reads.",
        {
            "same_magnitude": Sentence(
                "the magnitude of the accelerations stays within {spread:.1g} m/s^2 of {magnitude:.5g} m/s^2 while the"
                " board turns by {degrees:.0f} deg: this is a fusion filter's gravity, and no accelerometer's reading",
                RAW,
                True,
            ),
            "no_gravity": Sentence(
                "the accelerometer's median magnitude is {magnitude:.2g}: there is no gravity in it, as in a fusion"
                " filter's linear acceleration",
                RAW,
                True,
            ),
        },
        "mpucal.calibrate(replace(r, acc=9.81 * r.acc / (r.acc**2).sum(1, keepdims=True) ** 0.5))",
    ),
    "bits_stuck": Kind(
        "Bits of an axis never move: a byte is lost on its way, or the sensor is broken.",
        {
            "constant": Sentence(
                "the accelerometer reads the same on {axes} {when}, though the board was turned: it is broken or was"
                " not recorded",
                "check its wiring and the recording",
                True,
            ),
            "low": Sentence(
                "the low {bits} bits of the {sensor}'s {axis} never move{when}: it reads in steps of {step:.2g} {unit}",
                "check its wiring and the program that reads it, or take another sensor",
            ),
            "high": Sentence(
                "bit {bit} of the {sensor}'s {axis} never moves, though it passes values with it and without it",
                "check its wiring and the program that reads it, or take another sensor",
                True,
            ),
        },
        "mpucal session --bus sim:fault=low_byte@0 --seed 1",
        "a high bit never moves, an axis reads the same while the board is turned, or its steps are coarser than the"
        " calibration is sure",
        of_the_sensor=True,
    ),
    "gravity_unlikely": Kind(
        "The gravity that was given is that of no place on Earth, and all scale factors refer to it.",
        {
            "beyond_earth": Sentence(
                "the gravity that was given, {gravity:.4g} m/s^2, is that of no place on Earth ({least:g} to {most:g})",
                "give the local gravity, or --gravity-anyway (gravity_anyway=True in Python) where it is meant",
                False,
            ),
        },
        "mpucal.calibrate(r, gravity=9.2)",
    ),
    "same_data": Kind(
        "Calibrations to be merged were made of the same recording: counted twice, it would seem twice as certain.",
        {
            "merged": Sentence(
                "calibrations {numbers} were made of the same recording, whose data would count twice",
                "give calibrations of different recordings, each once",
                True,
            ),
        },
        "mpucal merge board7/calibration.json board7/calibration.json",
    ),
    "vibrating": Kind(
        "A motor or machine shook the sensor, faster than a hand does: its noise was larger than at rest.",
        {
            "noise": Sentence(
                "the accelerometer's noise is {std:.2g} m/s^2 rms while it is turned, by vibration in {share:.0%} of"
                " the samples",
                "switch motors off while you calibrate, or expect no better than the stated uncertainty",
                False,
            ),
        },
        "mpucal.calibrate(replace(r, acc=r.acc + numpy.random.default_rng(1).normal(0.0, 1.0, (len(r), 3))))",
    ),
    "zero_moved": Kind(
        "The accelerometer's bias stepped or drifted while the board was turned, by a knock or by warming.",
        {
            "walk": Sentence(
                "the accelerometer's bias moved by {size:.1f} mg, most of it from {begin:.0f} to {end:.0f} s",
                "let the board warm up first, keep knocks and pressure away from the sensor, and record again",
            ),
        },
        "mpucal.calibrate(replace(r, acc=r.acc + 0.05 * (r.t > 35.0)[:, None]))",
        "the error of a calibrated reading is above 0.4 m/s² (1 sigma)",
    ),
    "not_converged": Kind(
        "The estimate had not settled when its iterations were over.",
        {
            "iterations": Sentence(
                "the estimate had not settled after {iterations} iterations",
                "record again, with slower turns and pauses",
                True,
            ),
        },
        "mpucal.calibrate(r.part(0, 1500))",
        turn_again=True,
    ),
    "inconsistent": Kind(
        "The model does not explain the data: the sensor changed or moved on its board, or was disturbed.",
        {
            "innovations": Sentence(
                "the model does not explain the data (normalised innovations {nis:.0f}, expected 3): a hand's own"
                " acceleration or the gyroscope's scale factors",
                "use --model hand, turn slowly, and hold the board still often",
            ),
            "change": Sentence(
                "the sensor was not the same before {begin:.0f} s and after {end:.0f} s: what parts of the recording"
                " say of it differs by more than noise",
                "check whether its mount slipped or something knocked it, fasten it, and record again",
            ),
            "part": Sentence(
                "what was recorded from {begin:.0f} to {end:.0f} s contradicts the rest, and a calibrated reading is"
                " known to {rms:.2g} m/s^2 (1 sigma) only",
                "hold the board more calmly, and keep knocks and vibration away from it",
            ),
            "sides": Sentence(
                "the orientations contradict each other, and a calibrated reading is known to {rms:.2g} m/s^2 (1 sigma)"
                " only: the sensor's mount gives way, or the sensor is not linear",
                "fasten the sensor, hold the board more calmly, and record again",
            ),
            "slow": Sentence(
                "the orientations contradict each other, and a calibrated reading is known to {rms:.2g} m/s^2 (1 sigma)"
                " only: {rate:.3g} Hz are too slow to follow turns by hand",
                "sample at 50 Hz or more, and record again",
            ),
            "knock": Sentence(
                "something knocked the board (the accelerometer was at the end of its range), and {contradiction}",
                "let nothing knock it, fasten the sensor, and measure again",
                True,
            ),
        },
        "mpucal session --bus sim:hand=knocking --seed 1",
        "the contradiction is several times the limit",
        turn_again=True,
    ),
    "verification_failed": Kind(
        "New orientations, which the calibration has not seen, disagree with it, or none was shown.",
        {
            "not_shown": Sentence(
                "the board was held still in none of the requested orientations, so the calibration is not verified",
                "hold the board still for 2 s in each orientation that is asked for",
                False,
            ),
            "too_few": Sentence(
                "the board was held still in {number} of {of} orientations that the calibration has not seen, so it is"
                " not verified",
                "hold the board still for 2 s in each orientation that is asked for",
                False,
            ),
            "lost": Sentence(
                "samples are missing in every turn to an orientation that the calibration has not seen, so it is not"
                " verified",
                "use a nearer or faster link or a lower rate",
                False,
            ),
            "never_still": Sentence(
                "the board was never still in a new orientation, so the calibration is not verified",
                "hold the board still for 2 s in each orientation that is asked for",
                True,
            ),
            "nothing": Sentence("there is nothing to verify", "turn the board again", True),
            "gyroscope": Sentence(
                "the gyroscope's scale factor about {axis} differs by {share:.0%} from the turning before",
                "give the gyroscope's true range and rate, and turn more slowly",
                True,
            ),
            "direction": Sentence(
                "gravity, carried by the gyroscope to a new orientation, misses the accelerometer by {miss:.1f} deg,"
                " where {std:.1f} deg (1 sigma) was predicted: the sensor moved on its mount",
                "fasten the sensor to its board",
                True,
            ),
            "magnitude": Sentence(
                "in a new orientation |a| is {error:+.3f} m/s² off{knock}, where {std:.3f} m/s² (1 sigma) was"
                " predicted: the accelerometer changed, or slipped on its mount, while it was turned",
                "fasten the sensor, and let nothing press on, knock or warm it",
                True,
            ),
        },
        "mpucal session --bus sim:hand=repeating --seed 1",
        "a new orientation disagrees; if too few were shown, the calibration is usable",
        turn_again=True,
    ),
}
