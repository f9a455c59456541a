from functools import partial

import numpy as np
import pytest

from mpucal.chip.access import SessionEvent
from mpucal.data import Recording, Samples, Sensor
from mpucal.errors import Abandoned, CaptureError, ChipError, EndOfCapture, NoAnswer, SourceError
from mpucal.result.calibration import Calibration
from mpucal.session import runner as module
from mpucal.session.events import Decision, Key, Prompt, PromptKind
from mpucal.session.live_scheduler import InlineWorker
from mpucal.session.plan import Plan
from mpucal.session.ports import ReplayedOperator
from mpucal.session.results import result_files
from mpucal.session.runner import Runner

RATE_HZ, POLL = 100.0, 10
FLAT_POLLS = 110

NOT_THERE = NoAnswer("nothing answers at 0x68 any more", "check the wires")


class Source:
    """Lies flat for eleven seconds, then in one more orientation after another, and ends; `fails` by number of poll."""

    def __init__(self, fails=None, start=None):
        self.fails, self.start_fails = fails or {170: EndOfCapture()}, start
        self.polls, self.stops = 0, 0
        self.parts = []

    def start(self):
        if self.start_fails:
            raise self.start_fails
        return Sensor(chip="MPU-6050", accel_range_g=4.0, gyro_range_dps=500.0)

    def poll(self):
        self.polls += 1
        if self.polls in self.fails:
            raise self.fails[self.polls]
        turned = max(self.polls - FLAT_POLLS, 0) // 20
        up = np.random.default_rng(turned).normal(size=3) if turned else np.array([0.0, 0.0, 1.0])
        t = (np.arange(POLL) + 1 + self.polls * POLL) / RATE_HZ
        acc = np.tile(9.8 * up / np.linalg.norm(up), (POLL, 1))
        no = np.zeros(POLL, bool)
        samples = Samples(t, acc, np.zeros((POLL, 3)), np.full(POLL, 25.0), no, no, no)
        self.parts.append(samples)
        return samples

    def recording(self):
        return Recording(**vars(Samples.joined(self.parts)), sensor=Sensor(chip="MPU-6050"))

    def forget(self):
        self.parts = []

    def now_ns(self):
        return int(self.polls * POLL / RATE_HZ * 1e9)

    def stop(self):
        self.stops += 1


class Silent(Source):
    """Sends no samples from the poll `first` on."""

    def __init__(self, first):
        super().__init__({300: EndOfCapture()})
        self._first = first

    def poll(self):
        samples = super().poll()
        return samples if self.polls < self._first else Samples.empty()


class Person:
    """Presses keys when asked for the n-th time."""

    def __init__(self, keys=None):
        self.keys, self.asked, self.heard = keys or {}, 0, []

    def hear(self, output):
        self.heard.append(output)

    def pressed(self):
        self.asked += 1
        return self.keys.get(self.asked, [])

    def words(self):
        return " | ".join(output.why for output in self.heard if isinstance(output, Decision))


class Notes(list):
    def __call__(self, name, t_ns, data):
        self.append(SessionEvent(name, t_ns, data))


def fit(recording, verdict="good"):
    zeros = np.zeros(3)
    return Calibration(np.eye(3), zeros, np.zeros((3, 3)), zeros, quality={"verdict": verdict, "reasons": []})


def runner_of(source, person=None, **options):
    return Runner(source, person or Person(), Notes(), **options)


def calibrated(person=None, fit=fit):
    """Return a runner that has measured, its calibration, and its recording."""
    runner = runner_of(Source(), person)
    recording = runner.measure()
    return runner, runner.calibrate(recording, fit), recording


@pytest.mark.parametrize("asked", [1, 2, 50, 150], ids=["before connecting", "connected", "lay flat", "rotate"])
def test_ctrl_c_while_measuring_is_abandoned_and_leaves_the_sensor_at_rest(asked):
    source, notes = Source(), Notes()
    with pytest.raises(Abandoned, match="interrupted"):
        Runner(source, Person({asked: [Key.ABORT]}), notes).measure()
    assert source.stops == 1
    assert [(note.name, note.data) for note in notes] == [("key", {"key": "abort"})]


@pytest.mark.parametrize(
    ("files", "left"),
    [(1, []), (2, []), (4, ["calibration.bin", "calibration.json", "report.html"])],
    ids=["before the first file", "between two", "after all"],
)
def test_ctrl_c_leaves_all_files_or_none(tmp_path, files, left):
    person = Person()
    runner, calibration, recording = calibrated(person)
    person.keys = {person.asked + files: [Key.ABORT]}
    with pytest.raises(Abandoned):
        runner.write(tmp_path, result_files(calibration, recording))
    assert sorted(path.name for path in tmp_path.iterdir()) == left


@pytest.mark.parametrize(
    "error", [NOT_THERE, ChipError("the MPU-6050 lost its settings", "check")], ids=["bus", "chip"]
)
def test_a_source_that_fails_while_rotating_is_calibrated(error):
    source, person = Source({150: error}), Person()
    recording = runner_of(source, person).measure()
    assert len(recording) == 149 * POLL
    assert error.what in person.words()
    assert source.stops == 0


@pytest.mark.parametrize("poll", [1, 50], ids=["at once", "lay flat"])
def test_a_source_that_fails_before_is_its_own_error(poll):
    with pytest.raises(NoAnswer, match="nothing answers"):
        runner_of(Source({poll: NOT_THERE})).measure()


@pytest.mark.parametrize("source", [Source({20: EndOfCapture()}), Source(start=EndOfCapture())], ids=["flat", "start"])
def test_a_source_that_ends_before_turning_is_abandoned(source):
    with pytest.raises(Abandoned, match="ended before the board was turned"):
        runner_of(source).measure()


def test_a_capture_that_does_not_replay_is_never_calibrated():
    with pytest.raises(CaptureError, match="access 7"):
        runner_of(Source({150: CaptureError("access 7 is another one", "calibrate it")})).measure()


class Late:
    """Worker whose answers are done once the source was polled so many times more."""

    def __init__(self, source, polls, plan, sensor):
        self.source, self.polls, self.here = source, polls, InlineWorker(plan, sensor)

    def submit(self, task):
        answer, at = self.here.submit(task), self.source.polls + self.polls
        answer.done = lambda: self.source.polls >= at
        return answer

    def close(self):
        self.here.close()


def late_session(polls, keys=None, ends_at=170):
    """Measure with answers that are `polls` late; return the recording, the person and the notes."""
    source, person, notes = Source({ends_at: EndOfCapture()}), Person(keys), Notes()
    runner = Runner(source, person, notes, start_worker=partial(Late, source, polls))
    return runner.measure(), person, notes


def waits(notes):
    return [note.t_ns for note in notes if note.name == "late"]


@pytest.mark.parametrize(
    ("polls", "ends_at"), [(0, 170), (12, 170), (12, 131)], ids=["punctual", "late", "ends while one is late"]
)
def test_a_replay_presses_the_keys_and_waits_where_its_session_did(polls, ends_at):
    # A key that is pressed while an answer is late reaches the machine in the same place.
    live, person, notes = late_session(polls, {141: [Key.ENOUGH]}, ends_at)
    assert bool(waits(notes)) == bool(polls)
    assert ("you chose to go on" in person.words()) == (ends_at == 170)
    again, listener = Source({ends_at: EndOfCapture()}), Person()
    pending, notes_again = list(notes), Notes()

    # A bus returns each recorded event once, when the accesses before it are done.
    def events(name):
        due = [event for event in pending if event.t_ns <= again.now_ns() and event.name == name]
        pending[:] = [event for event in pending if event not in due]
        return due

    runner = Runner(again, ReplayedOperator(listener, events), notes_again, late=lambda _late: bool(events("late")))
    assert np.array_equal(runner.measure().t, live.t)
    assert listener.heard == person.heard
    assert notes_again == notes
    assert not pending


@pytest.mark.parametrize(
    ("person", "seconds", "polls", "key"),
    [
        (Person(), 3.0, 30, "abort"),
        (Person(), 15.0, 150, "enough"),
        (Person({41: [Key.ABORT]}), None, 40, "abort"),
        (Person({151: [Key.ENOUGH]}), 99.0, 150, "enough"),
    ],
    ids=["seconds, flat", "seconds, rotating", "Ctrl-C, flat", "Enter, rotating"],
)
def test_recording_ends_when_asked_and_leaves_the_key_that_replays_it(person, seconds, polls, key):
    source, notes = Source(), Notes()
    assert Runner(source, person, notes, plan=Plan(until_end=True)).record(seconds) == polls * POLL
    assert [note.data for note in notes] == [{module.KEY: key}]
    # no fit was made
    assert PromptKind.REST not in {of.kind for of in person.heard if isinstance(of, Prompt)}
    assert source.stops == 1
    assert not source.parts


@pytest.mark.parametrize("first", [20, 150], ids=["flat", "rotating"])
def test_recording_of_a_source_that_falls_silent_is_an_error(first):
    runner = runner_of(Silent(first), plan=Plan(until_end=True))
    with pytest.raises((SourceError, Abandoned), match="the sensor sent no samples for 5 s"):
        runner.record(None)
    assert runner.samples == (first - 1) * POLL
