import numpy as np
import pytest

from mpucal.data import Samples, Sensor
from mpucal.session.events import (
    Abort,
    Connected,
    Decision,
    Enough,
    Fitted,
    Measured,
    Progress,
    Prompt,
    PromptKind,
    SourceEnded,
    Tick,
    Written,
)
from mpucal.session.machine import Machine
from mpucal.session.table import State


class Session:
    """A machine, fed with samples in polls of 50 ms, and all that it said."""

    def __init__(self, **options):
        self.machine = Machine(**options)
        self.said = self.machine.handle(Connected(Sensor()))

    def feed(self, samples, poll=5):
        for first in range(0, len(samples), poll):
            if self.state not in (State.LAY_FLAT, State.ROTATE):
                break
            part = slice(first, first + poll)
            self.give(Measured(Samples(*(array[part] for array in vars(samples).values()))))
        return self

    def give(self, event):
        self.said += self.machine.handle(event)
        return self

    @property
    def state(self):
        return self.machine.state

    def prompts(self):
        return [output.kind for output in self.said if isinstance(output, Prompt)]

    def words(self):
        return " | ".join(getattr(output, "text", "") or getattr(output, "why", "") for output in self.said)

    def count(self):
        return [output.done for output in self.said if isinstance(output, Progress)][-1]


@pytest.fixture
def rotating(board):
    session = Session().feed(board.still(10.6))
    assert session.state is State.ROTATE
    return session


def test_tells_to_lay_flat_then_to_rotate_after_ten_seconds_of_stillness(board):
    session = Session()
    assert session.prompts() == [PromptKind.LAY_FLAT]
    assert session.feed(board.still(9.5)).state is State.LAY_FLAT
    assert session.feed(board.still(1.1)).state is State.ROTATE
    assert session.prompts() == [PromptKind.LAY_FLAT, PromptKind.ROTATE]


@pytest.mark.parametrize(
    ("disturb", "what"),
    [
        (lambda board: board.turn((0, 1, 0), 0.5, 1.0), "m/s² along x"),
        (lambda board: board.turn((0, 0, 1), 2.0, 1.0), "deg/s about z"),
        (lambda board: board.shaken(1.0, 2.0), "m/s² along x"),
    ],
    ids=["tilted", "turned about the vertical", "shaken"],
)
def test_a_bump_starts_the_count_again_and_says_what_moved(board, disturb, what):
    session = Session().feed(board.still(8.0)).feed(disturb(board)).feed(board.still(8.0))
    assert session.state is State.LAY_FLAT
    assert what in session.words()
    assert session.prompts() == [PromptKind.LAY_FLAT, PromptKind.LAY_FLAT]
    assert session.feed(board.still(3.0)).state is State.ROTATE


def test_a_slow_turn_at_a_constant_rate_is_not_stillness(board):
    """It has no variance, only a mean that moves."""
    session = Session().feed(board.turn((1, 0, 0), np.radians(30.0), 20.0))
    assert session.state is State.LAY_FLAT


def test_a_noisy_sensor_can_be_still(make_board):
    assert Session().feed(make_board(acc_noise=0.3, gyr_noise=0.1).still(10.6)).state is State.ROTATE


def test_a_large_gyro_bias_is_no_turn(make_board):
    assert Session().feed(make_board(gyr_bias=(0.35, -0.35, 0.35)).still(10.6)).state is State.ROTATE


def test_never_still_for_a_minute_is_abandoned_with_a_reason(board):
    session = Session()
    for _ in range(15):
        session.feed(board.still(3.0)).feed(board.shaken(1.2, 3.0))
    assert session.state is State.ABORTED
    last = [output for output in session.said if isinstance(output, Decision)][-1]
    assert "not still for 10 s within 60 s" in last.why
    assert "m/s² along x" in last.why
    assert "firm" in last.remedy


def test_until_end_waits_for_stillness_for_ever(board):
    session = Session(until_end=True).feed(board.shaken(80.0, 3.0))
    assert session.state is State.LAY_FLAT
    assert session.feed(board.still(11.5)).state is State.ROTATE


def test_twelve_varied_pauses_are_enough_within_fifty_seconds(board, rotating, varied):
    begun_s = board.t_s
    for up in varied:
        rotating.feed(board.turn_to(up)).feed(board.still(2.0))
    assert rotating.state is State.CALIBRATE
    assert 35.0 < rotating_end_s(rotating) - begun_s < 50.0
    assert "orientation 5 of 12" in rotating.words()
    assert rotating.prompts()[-1] is PromptKind.REST


def rotating_end_s(session):
    return [output.t_s for output in session.said if isinstance(output, Progress)][-1]


def test_six_faces_are_not_enough_and_a_corner_is_wanted(board, rotating):
    faces = [(1, 0, 0), (0, 1, 0), (0, 0, -1), (0, -1, 0), (-1, 0, 0), (0, 0, 1)]
    for up in [*faces, *faces]:
        rotating.feed(board.turn_to(up)).feed(board.still(2.0))
    assert rotating.state is State.ROTATE
    assert rotating.count() == 6
    hint = [output.text for output in rotating.said if isinstance(output, Progress)][-1].split("helps: ")[1]
    assert len(hint.split(", ")) >= 2


def test_tilts_about_one_axis_are_never_enough(board, rotating):
    for angle in np.radians(np.arange(25.0, 360.0, 25.0)):
        rotating.feed(board.turn_to((0, np.sin(angle), np.cos(angle)))).feed(board.still(2.0))
    assert rotating.count() == 12
    assert rotating.state is State.ROTATE


def test_turning_without_a_pause_is_enough_in_the_end(board, rotating):
    rng = np.random.default_rng(5)
    for _ in range(60):
        rotating.feed(board.turn(rng.normal(size=3), rng.uniform(1.5, 2.5), 1.5))
        if rotating.state is not State.ROTATE:
            break
    assert rotating.state is State.CALIBRATE
    assert board.t_s - 10.6 > 30.0


def test_no_new_orientation_for_a_minute_ends_the_turning(board, rotating):
    rotating.feed(board.turn_to((1, 0, 0))).feed(board.still(59.0))
    assert rotating.state is State.ROTATE
    rotating.feed(board.still(3.0))
    assert rotating.state is State.CALIBRATE
    assert "no new orientation for 60 s, 2 of 12 are there" in rotating.words()


def test_until_end_turns_until_the_source_ends(board, varied):
    session = Session(until_end=True).feed(board.still(10.6))
    for up in varied:
        session.feed(board.turn_to(up)).feed(board.still(2.0))
    assert session.feed(board.still(62.0), poll=50).state is State.ROTATE
    assert session.give(SourceEnded()).state is State.CALIBRATE


def test_a_source_that_ends_while_rotating_is_calibrated(rotating):
    assert rotating.give(SourceEnded()).state is State.CALIBRATE
    assert "the source ended" in rotating.words()


def test_a_source_that_fails_while_rotating_is_calibrated_and_says_why(rotating):
    assert rotating.give(SourceEnded("nothing answers at 0x68")).state is State.CALIBRATE
    assert "nothing answers at 0x68" in rotating.words()


def test_a_source_that_ends_before_is_abandoned(board):
    session = Session().feed(board.still(5.0)).give(SourceEnded())
    assert session.state is State.ABORTED
    assert "ended before the board was turned" in session.words()


def test_enter_cuts_the_stillness_short_once_there_is_some(board):
    session = Session().feed(board.still(1.2)).give(Enough())
    assert session.state is State.LAY_FLAT
    assert session.feed(board.still(2.0)).give(Enough()).state is State.ROTATE


def test_enter_ends_the_turning(rotating):
    assert rotating.give(Enough()).state is State.CALIBRATE


def test_silence_before_turning_is_abandoned(board):
    session = Session().feed(board.still(3.0)).give(Tick(board.t_s + 4.0))
    assert session.state is State.LAY_FLAT
    assert session.give(Tick(board.t_s + 5.1)).state is State.ABORTED
    assert "no samples for 5 s" in session.words()


def test_silence_while_turning_ends_it(board, rotating):
    assert rotating.give(Tick(board.t_s + 5.1)).state is State.CALIBRATE


def test_runs_to_the_end_even_if_refused(rotating):
    rotating.give(Enough()).give(Fitted("refused")).give(Written(("calibration.json",)))
    assert rotating.state is State.DONE
    assert "refused" in rotating.words()


@pytest.mark.parametrize("events", [[], [Enough()], [Enough(), Fitted("good")]], ids=["rotate", "fit", "write"])
def test_can_be_aborted(rotating, events):
    for event in events:
        rotating.give(event)
    assert rotating.give(Abort()).state is State.ABORTED


def test_decides_the_same_however_the_samples_arrive(make_board, varied):
    def decided(poll):
        board, session = make_board(), Session()
        parts = [board.shaken(1.0, 2.0), board.still(11.0)]
        for up in varied:
            parts += [board.turn_to(up), board.still(2.0)]
        session.feed(Samples.joined(parts), poll)
        return [output for output in session.said if not isinstance(output, Progress)]

    assert decided(3) == decided(7) == decided(50)
