import pickle

import numpy as np
import pytest

from mpucal.data import Samples, Sensor
from mpucal.reasons import Reason
from mpucal.session import events
from mpucal.session.machine import Machine
from mpucal.session.plan import Plan
from mpucal.session.table import TRANSITIONS, IllegalEvent, State

MEASURING = (State.LAY_FLAT, State.ROTATE, State.VERIFY)
DOWN = (0.0, 0.6, -0.8)
MOVED = Reason("verification_failed", "the sensor moved on its mount", "fasten it", True)
DOUBT = Reason("inconsistent", "a part contradicts the rest", "hold it more calmly", False)


def learnt(overall=0.1, advice=True, down=DOWN):
    three = (overall, overall, overall)
    wanted = events.Target(0.1, 0.05, 1.0)
    words = "bias to 3 mg"
    return events.Learnt(
        events.Knowledge(
            0.0, three, three, three, wanted, three, three, three, overall, down if advice else None, words
        ),
        advice,
    )


class Session:
    """A machine, fed with samples in polls of 200 ms, and all that it said.

    What it asks for is answered at once: with `overall` as far as is known (None: not at all), `tried` and `checked`.
    """

    def __init__(self, checking=False, **options):
        self.overall, self.tried, self.checked = None, events.Tried("good"), events.Checked((), agrees=True)
        self.machine = Machine(Plan(**options), checking)
        self.said = self.machine.handle(events.Connected(Sensor(accel_range_g=4.0, gyro_range_dps=500.0)))

    def feed(self, samples, poll=40):
        for first in range(0, len(samples), poll):
            if self.state not in MEASURING:
                break
            self.give(events.Measured(samples.at(slice(first, first + poll))))
        return self

    def give(self, event):
        outputs = self.machine.handle(event)
        self.said += outputs
        for ask in (output for output in outputs if isinstance(output, events.RequestFit)):
            answer = self.answer(ask.kind)
            if answer is not None and self.state in MEASURING:
                self.give(answer)
        return self

    def answer(self, wish):
        if wish in (events.FitKind.KNOW, events.FitKind.ADVISE):
            return None if self.overall is None else learnt(self.overall, wish is events.FitKind.ADVISE)
        return self.tried if wish is events.FitKind.TRY else self.checked

    def of(self, kind):
        return [output for output in self.said if isinstance(output, kind)]

    @property
    def state(self):
        return self.machine.state

    def prompts(self):
        return [output.kind for output in self.said if isinstance(output, events.Prompt)]

    def words(self):
        names = ("text", "why", "what")
        return " | ".join(getattr(output, name) for output in self.said for name in names if hasattr(output, name))

    def count(self):
        return [output.done for output in self.said if isinstance(output, events.Progress)][-1]


@pytest.fixture(scope="module")
def laid(make_board):
    """Pickled state of a board that has lain flat for long enough, and of its session."""
    board = make_board()
    session = Session().feed(board.still(10.6))
    assert session.state is State.ROTATE
    return pickle.dumps((vars(board), session))


def restored(board, pickled):
    """Put the board into its pickled state; return the session."""
    now, session = pickle.loads(pickled)
    vars(board).update(now)
    return session


@pytest.fixture
def rotating(board, laid):
    return restored(board, laid)


@pytest.mark.parametrize(
    ("disturb", "what"),
    [
        (lambda board: board.turn((0, 1, 0), 0.5, 1.0), "m/s² along x"),
        (lambda board: board.turn((0, 0, 1), 2.0, 1.0), "deg/s about z"),
    ],
    ids=["tilted", "turned about the vertical"],
)
def test_a_moved_board_restarts_the_countdown_with_a_caution(board, disturb, what):
    session = Session().feed(board.still(8.0)).feed(disturb(board)).feed(board.still(8.0))
    assert session.state is State.LAY_FLAT
    assert what in session.words()
    assert [caution.code for caution in session.of(events.Caution)][-1] == "moved"
    assert max(countdown.remaining_s for countdown in session.of(events.Countdown)[-16:]) == pytest.approx(9.5, abs=0.6)
    assert session.feed(board.still(3.0)).state is State.ROTATE


def test_never_still_for_a_minute_is_abandoned_with_a_reason(board):
    session = Session()
    for _ in range(15):
        session.feed(board.still(3.0)).feed(board.turn((1, 0, 0), 0.3, 1.2))
    assert session.state is State.ABORTED
    last = [output for output in session.said if isinstance(output, events.Decision)][-1]
    assert "not still for 10 s within 60 s" in last.why
    assert "deg/s about x" in last.why
    assert "firm" in last.remedy


def show(session, board, ups):
    """Turn to one orientation after the other, and hold each."""
    for up in ups:
        session.feed(board.turn_to(up)).feed(board.still(2.0))
    return session


def test_asks_for_the_orientation_that_helps_most_as_soon_as_one_was_held(board, rotating):
    rotating.overall = 0.1
    rotating.feed(board.turn_to((1, 0, 0))).feed(board.still(0.6))
    assert rotating.prompts().count(events.PromptKind.ROTATE) == 1
    rotating.feed(board.still(0.6))
    asked = rotating.of(events.Prompt)[-1]
    assert (asked.kind, asked.down) == (events.PromptKind.ROTATE, DOWN)
    assert asked.text == "Turn the board: on its far edge, chip tilted up (+Y −Z), then hold it still."
    assert rotating.prompts().count(events.PromptKind.ROTATE) == 2
    assert rotating.feed(board.still(3.0)).prompts().count(events.PromptKind.ROTATE) == 2


def placed(make_board, tremor, target="normal", late=False, known=1.0, down=DOWN, elsewhere=()):
    """A vehicle is put on its sides as it is asked for, by somebody who lets go of it (no tremor) or does not.

    late : a fit is not done when the first hold ends. known, down : see learnt.
    elsewhere : numbers of the prompts at which it is put on its tail.
    """
    board, session = make_board(), Session()
    board.up = np.array([0.0, 0.0, -1.0])
    session.board, session.machine = board, Machine(Plan(target=target))
    session.said = session.machine.handle(events.Connected(Sensor(message="RAW_IMU")))
    assert "still for 2 s" in session.of(events.Prompt)[-1].text
    session.feed(board.still(2.6))
    # The advice comes at the end of the hold.
    session.answer = lambda wish: learnt(1.0, advice=False) if wish is events.FitKind.KNOW and not late else None
    held = []
    while session.state is State.ROTATE and len(held) < 6:
        asked, before = session.of(events.Prompt)[-1], len([one for one in session.said if is_advice(one)])
        held.append(asked.text.split(": ")[1].split(" (")[0])
        session.feed(board.turn_to((1.0, 0.0, 0.0) if len(held) in elsewhere else -np.array(asked.down)))
        if late:
            session.feed(board.still(1.0)).give(learnt(1.0, advice=False))
        session.feed(board.shaken(1.5, tremor) if tremor else board.still(1.5))
        if len([one for one in session.said if is_advice(one)]) > before:
            session.give(learnt(known, down=down))
        late = False
    return session, held


@pytest.mark.parametrize("late", [False, True])
def test_a_vehicle_that_is_put_down_on_six_sides_needs_one_tilt_more(make_board, late):
    session, (*sides, tilt) = placed(make_board, 0.0, "quick", late)
    assert sides == ["on its left side", "nose down", "on its back", "on its right side", "nose up"]
    assert "tilted" in tilt
    assert session.state is State.VERIFY
    assert "Verification 1 of 1" in session.of(events.Prompt)[-1].text


def test_each_side_is_asked_for_as_soon_as_a_vehicle_lies_on_the_one_before(make_board):
    session, (*sides, _) = placed(make_board, 0.0)
    assert [each.use for each in session.of(events.Held)[: len(sides)]] == [events.Use.TAKEN] * len(sides)
    asked = [one.kind for one in session.said if isinstance(one, events.Prompt) or is_advice(one)]
    # the flat rest, the sides, the tilt, a fit that tells whether the target is reached, and the verification
    assert asked == ["lay_flat", *["rotate"] * (len(sides) + 1), "advise", "verify"]


def is_advice(output):
    return isinstance(output, events.RequestFit) and output.kind is events.FitKind.ADVISE


def test_a_vehicle_that_was_on_all_its_sides_is_not_put_on_one_again(make_board):
    session, (*_, last) = placed(make_board, 0.0, known=0.1, down=(0.0, 1.0, 0.0))
    assert "tilted" in last
    assert session.state is State.ROTATE
    assert "tilted" in session.of(events.Prompt)[-1].text


def test_a_side_that_a_vehicle_was_not_put_on_is_asked_for_again_and_the_other_is_not(make_board):
    _, sides = placed(make_board, 0.0, elsewhere=(2,))
    assert sides[:5] == ["on its left side", "nose down", "on its back", "nose down", "on its right side"]
    assert "tilted" in sides[5]


@pytest.mark.parametrize(("verdict", "of"), [("good", 1), ("usable", 2)])
def test_a_first_calibration_with_reservations_is_verified_twice(make_board, verdict, of):
    session, _ = placed(make_board, 0.0)
    session.give(events.Tried(verdict))
    session.feed(session.board.turn_to(-np.array(session.of(events.Prompt)[-1].down))).feed(session.board.still(2.0))
    assert [each.of for each in session.of(events.Progress)][-1] == of
    assert ("Verification 2 of 2" in session.of(events.Prompt)[-1].text) is (of == 2)


def test_a_vehicle_in_a_hand_is_turned_onto_its_sides_too(make_board):
    session, held = placed(make_board, 0.15)
    assert held == placed(make_board, 0.0)[1]
    assert session.state is State.VERIFY


def test_a_vehicle_in_a_hand_does_not_lie_flat(make_board):
    board, session = make_board(), Session()
    session.machine = Machine(Plan())
    session.machine.handle(events.Connected(Sensor(message="RAW_IMU")))
    session.feed(board.shaken(4.0, 0.35))
    assert session.state is State.LAY_FLAT
    assert session.feed(board.still(3.0)).state is State.ROTATE


def test_once_the_target_is_reached_each_orientation_asked_for_is_a_new_one(rotating, board):
    rotating.overall = 1.0
    for _ in range(6):
        show(rotating, board, [-np.array(rotating.of(events.Prompt)[-1].down)])
    asked = np.array([prompt.down for prompt in rotating.of(events.Prompt) if prompt.down])
    assert (asked @ asked.T)[np.triu_indices(len(asked), 1)].max() < np.cos(np.radians(20.0))


def test_enough_orientations_and_the_target_lead_on_to_verify(board, rotating, varied):
    rotating.overall = 1.0
    show(rotating, board, varied[:8])
    assert rotating.state is State.ROTATE
    assert [seen.number for seen in rotating.of(events.Seen)] == [2, 3, 4, 5, 6, 7, 8, 9]
    show(rotating, board, varied[8:9])
    assert rotating.state is State.VERIFY
    assert "target reached: bias to 3 mg" in rotating.words()
    full = "orientation 5 of 10 (bars full; more sides confirm them)"
    assert full in [progress.text for progress in rotating.of(events.Progress)]


def test_the_time_that_is_left_follows_the_pace_and_the_information(board, rotating, varied):
    rotating.overall = 0.1
    show(rotating, board, varied[:2])
    assert {one.left_s for one in rotating.of(events.Progress)} == {None}
    show(rotating, board, varied[2:5])
    # 6 of 10 orientations, at 3.6 s for each; the verification needs 3 more.
    assert rotating.of(events.Progress)[-1].left_s == pytest.approx(7 * 3.6, abs=3.6)
    show(rotating, board, varied[5:7])
    assert rotating.of(events.Progress)[-1].text.startswith("orientation 8 of 10")
    assert rotating.of(events.Progress)[-1].left_s is None
    rotating.overall = 0.7
    show(rotating, board, varied[7:8])
    # What is known is half of what is needed.
    assert rotating.of(events.Progress)[-1].left_s > 8 * 3.6
    rotating.overall = 1.0
    rotating.feed(board.still(6.0))
    assert rotating.of(events.Progress)[-1].left_s == pytest.approx(3 * 3.6, abs=3.6)
    rotating.feed(board.still(10.0))
    assert rotating.of(events.Progress)[-1].left_s is None


def test_enough_tilts_end_the_turning_and_claim_no_target(board):
    session = Session(tilt_only=True).feed(board.still(10.6))
    session.overall = 0.1
    around = np.radians(np.arange(0.0, 300.0, 60.0))
    tilts = [(0.5 * np.cos(angle), 0.5 * np.sin(angle), 0.87) for angle in around]
    show(session, board, tilts[:4])
    assert session.state is State.ROTATE
    show(session, board, tilts[4:])
    assert session.state is State.VERIFY
    assert "orientation 5 of 6" in session.words()
    assert "enough tilts seen: bias to 3 mg" in session.words()
    assert "target reached" not in session.words()


@pytest.mark.parametrize(
    ("ups", "why"),
    [
        (
            [(1, 0, 0), (0, 1, 0), (0, 0, -1), (0, -1, 0), (-1, 0, 0), (0, 0, 1)] * 2,
            "; more sides confirm them",
        ),
        (
            [(0, np.sin(angle), np.cos(angle)) for angle in np.radians(np.arange(25.0, 360.0, 25.0))],
            ", but too similar",
        ),
    ],
    ids=["faces", "tilts about one axis"],
)
def test_the_target_is_not_enough_without_varied_orientations(board, rotating, ups, why):
    rotating.overall = 1.0
    assert show(rotating, board, ups).state is State.ROTATE
    assert f"(bars full{why})" in rotating.of(events.Progress)[-1].text


def test_without_the_target_turning_goes_on_for_two_minutes(board, rotating):
    rotating.overall = 0.3
    rng = np.random.default_rng(5)
    begun_s = board.t_s
    while rotating.state is State.ROTATE:
        rotating.feed(board.turn(rng.normal(size=3), rng.uniform(1.5, 2.5), 1.5))
    assert rotating.state is State.VERIFY
    assert 119.0 < board.t_s - begun_s < 123.0
    assert "for turning reached: bias to 3 mg" in rotating.words()


def test_no_new_orientation_for_a_minute_ends_the_turning(board, rotating):
    rotating.feed(board.turn_to((1, 0, 0))).feed(board.still(59.0))
    assert rotating.state is State.ROTATE
    assert "no new orientation for a while" in rotating.words()
    rotating.feed(board.still(3.0))
    assert rotating.state is State.VERIFY
    assert "no new orientation for 60 s, 2 seen" in rotating.words()


@pytest.fixture(scope="module")
def turned(make_board, laid, varied):
    """Pickled state of a board that has been turned enough, and of its session."""
    board = make_board()
    session = restored(board, laid)
    session.overall = 1.0
    show(session, board, varied[:9])
    assert session.state is State.VERIFY
    return pickle.dumps((vars(board), session))


@pytest.fixture
def verifying(board, turned):
    return restored(board, turned)


def test_verifies_in_three_orientations_that_were_not_seen(board, verifying, varied):
    seen = -np.array([seen.down for seen in verifying.of(events.Seen)])
    for number in (1, 2, 3):
        asked = verifying.of(events.Prompt)[-1]
        assert asked.kind is events.PromptKind.VERIFY
        assert f"{number} of 3" in asked.text
        assert (-seen @ np.array(asked.down)).max() < np.cos(np.radians(25.0))
        verifying.feed(board.turn_to([-v for v in asked.down])).feed(board.still(2.0))
    requested = [request.kind for request in verifying.of(events.RequestFit)]
    assert [kind for kind in requested if kind in (events.FitKind.TRY, events.FitKind.CHECK)] == [
        events.FitKind.TRY,
        events.FitKind.CHECK,
    ]
    assert verifying.state is State.CALIBRATE
    assert "agree with the predicted uncertainty" in verifying.words()
    assert verifying.machine.checked.agrees


def test_an_orientation_that_was_seen_already_does_not_count(board, verifying, varied):
    asked = verifying.of(events.Prompt)[-1]
    # 15 deg from one that was seen, and far from what is asked for
    near = np.array(varied[2]) / np.linalg.norm(varied[2])
    aside = near + np.tan(np.radians(15.0)) * np.array([0.0, 1.0, 0.0])
    show(verifying, board, [aside, *varied[3:6]])
    assert verifying.state is State.VERIFY
    cautions = [caution for caution in verifying.of(events.Caution) if caution.code == "seen_already"]
    assert len(cautions) >= 4
    assert all((c.what, c.do) == ("this orientation was seen already", asked.text) for c in cautions)
    assert verifying.of(events.Prompt)[-1] == asked
    verifying.feed(board.still(40.0))
    assert verifying.machine.checked.agrees is None


STAYS = events.Checked((), False, DOUBT, doubtful=True)
LAST = events.Verification(60.0, 1, 1, DOWN, 0.004, 0.003, 0.02, 0.03, True, "new orientation 1 of 1: |a| error")


@pytest.mark.parametrize("then", [events.Checked((LAST,), True), STAYS], ids=["settled", "stays"])
def test_a_doubt_that_new_orientations_do_not_share_is_decided_by_one_more(board, verifying, then):
    verifying.checked = STAYS
    for number in range(4):
        assert verifying.state is State.VERIFY
        verifying.checked = then if number == 3 else verifying.checked
        asked = verifying.of(events.Prompt)[-1]
        verifying.feed(board.turn_to([-v for v in asked.down])).feed(board.still(2.0))
    assert "4 of 4" in asked.text
    assert [caution.what for caution in verifying.of(events.Caution) if caution.code == "doubtful"] == [DOUBT.what]
    assert [request.kind for request in verifying.of(events.RequestFit)].count(events.FitKind.TRY) == 2
    assert verifying.state is State.CALIBRATE
    assert verifying.machine.checked == then
    counted = [(each.number, each.of, each.text) for each in verifying.of(events.Verification)]
    assert counted == [(4, 4, "new orientation 4 of 4: |a| error")] * len(then.verifications)


def test_a_doubt_stands_where_nobody_holds_one_more_orientation(board, verifying):
    verifying.checked = STAYS
    for _ in range(3):
        asked = verifying.of(events.Prompt)[-1]
        verifying.feed(board.turn_to([-v for v in asked.down])).feed(board.still(2.0))
    verifying.feed(board.still(50.0))
    assert verifying.state is State.CALIBRATE
    assert verifying.machine.checked == STAYS
    assert "in none of the requested orientations" not in verifying.words()


def test_the_verification_times_out(board, verifying):
    verifying.feed(board.still(41.0))
    assert verifying.state is State.CALIBRATE
    assert "held still in none of the requested orientations" in verifying.words()
    assert verifying.machine.checked.agrees is None


@pytest.fixture
def offered(board, varied):
    """A session in which somebody may press keys, and the new orientations disagree."""
    session = Session(attended=True).feed(board.still(10.6))
    session.overall = 1.0
    session.checked = events.Checked((), False, MOVED)
    show(show(session, board, varied[:9]), board, varied[9:12])
    assert session.state is State.VERIFY
    assert session.prompts()[-1] is events.PromptKind.AGAIN
    assert "Turn the board again from the start (r)" in session.words()
    assert (session.of(events.Caution)[-1].what, session.of(events.Caution)[-1].do) == (
        "the sensor moved on its mount",
        "fasten it",
    )
    return session


def test_the_board_may_be_turned_again_after_a_refusal(board, offered):
    offered.feed(board.still(50.0)).give(events.Redo())
    assert offered.state is State.ROTATE
    assert offered.machine.checked is None
    assert len(offered.of(events.Forget)) == 1


def test_the_refusal_stays_without_another_turning(board, offered):
    offered.feed(board.still(61.0))
    assert offered.state is State.CALIBRATE
    assert offered.machine.checked.reason == MOVED
    assert offered.words().count("the sensor moved on its mount") == 2


def test_redo_turns_again_without_laying_flat_again(board, verifying):
    samples = verifying.machine._samples
    verifying.give(events.Redo())
    assert verifying.state is State.ROTATE
    (forget,) = verifying.of(events.Forget)
    assert forget.last == samples
    assert 1000 <= forget.first <= 1060
    assert verifying.prompts()[-1] is events.PromptKind.ROTATE


def test_a_resumed_session_repeats_its_prompt(board, rotating):
    rotating.overall = 0.1
    rotating.feed(board.turn_to((1, 0, 0))).feed(board.still(2.0))
    wanted = rotating.of(events.Prompt)[-1]
    rotating.give(events.Resumed())
    assert rotating.state is State.ROTATE
    assert rotating.of(events.Prompt)[-1] == wanted
    board.silence(20.0)
    assert rotating.feed(board.still(3.0)).give(events.Tick(board.t_s)).state is State.ROTATE


def test_cautions_are_not_repeated_at_once(board, rotating):
    fast = board.turn((0, 0, 1), 14.0, 2.0)
    fast.gyr_clipped[40:60] = True
    rotating.feed(fast)
    codes = [caution.code for caution in rotating.of(events.Caution)]
    assert codes == ["too_fast", "clipped"]


@pytest.mark.parametrize(("seconds", "state"), [(6.0, State.ROTATE), (3.0, State.LAY_FLAT)])
def test_until_end_accepts_a_shorter_rest(board, seconds, state):
    session = Session(until_end=True).feed(board.still(seconds))
    assert session.state is State.LAY_FLAT
    assert session.feed(board.turn((1, 0, 0), 1.0, 1.0)).state is state


def test_enter_cuts_the_stillness_short_once_there_is_some(board):
    session = Session().feed(board.still(1.2)).give(events.Enough())
    assert session.state is State.LAY_FLAT
    assert session.feed(board.still(2.0)).give(events.Enough()).state is State.ROTATE


def test_silence_before_turning_is_abandoned(board):
    session = Session().feed(board.still(3.0)).give(events.Tick(board.t_s + 4.0))
    assert session.state is State.LAY_FLAT
    assert session.give(events.Tick(board.t_s + 5.1)).state is State.ABORTED
    assert "no samples for 5 s" in session.words()


def test_decisions_are_the_same_for_any_division_of_the_samples(make_board, varied):
    def decided(poll):
        board, session = make_board(), Session()
        parts = [board.shaken(1.0, 2.0), board.still(11.0)]
        for up in varied:
            parts += [board.turn_to(up), board.still(2.0)]
        session.feed(Samples.joined(parts), poll)
        return [output for output in session.said if isinstance(output, events.Prompt | events.Decision)], len(
            session.of(events.Seen)
        )

    assert decided(3) == decided(50)


def test_an_illegal_event_changes_no_state():
    machine = Machine()
    with pytest.raises(IllegalEvent):
        machine.handle(events.Fitted("good"))
    assert machine.state is State.CONNECT
    machine.handle(events.Connected(Sensor()))
    assert machine.state is State.LAY_FLAT


def test_every_state_but_the_last_two_can_be_aborted():
    assert [state for state in State if events.Abort not in TRANSITIONS[state]] == [State.DONE, State.ABORTED]
