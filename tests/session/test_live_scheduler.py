"""FitScheduler: their answers are brought at fixed numbers of samples, whoever computes them."""

import os
import signal
import subprocess
import sys
from concurrent.futures import Future
from dataclasses import replace

import numpy as np
import pytest

from mpucal.data import Samples, Sensor
from mpucal.errors import Abandoned
from mpucal.session.events import FitKind, RequestFit
from mpucal.session.live_scheduler import FitScheduler, InlineWorker, ProcessWorker
from mpucal.session.plan import Plan
from tools.lab.scenarios.recordings import hand_scenario
from tools.lab.scenarios.sensors import GRAVITY_MPS2

SENSOR = Sensor(chip="MPU-6050", rate_hz=200.0)
PLAN = Plan(gravity=GRAVITY_MPS2)


def nothing(n):
    """n samples of no meaning."""
    return Samples.empty().each(lambda none: np.zeros((n, *none.shape[1:])))


@pytest.fixture(scope="module")
def poses():
    return hand_scenario(3, "pose12").recording.at(slice(200 * 22))


class Slow:
    """Answers when it is told to."""

    def __init__(self, *_plan_and_sensor):
        self.tasks, self.answers = [], []

    def submit(self, task):
        self.tasks.append(task)
        self.answers.append(Future())
        return self.answers[-1]

    def close(self):
        self.tasks = None


@pytest.fixture
def slow():
    return Slow()


@pytest.fixture
def scheduler(slow):
    return FitScheduler(PLAN, SENSOR, lambda *_: slow)


def test_an_answer_is_brought_after_the_asked_number_of_samples_and_no_sooner(scheduler, slow):
    scheduler.add(nothing(1000))
    scheduler.request(RequestFit(FitKind.KNOW, 0.5))
    slow.answers[0].set_result("known")
    scheduler.add(nothing(99))
    assert not scheduler.due
    assert scheduler.answers() == []
    scheduler.add(nothing(1))
    assert scheduler.due
    assert not scheduler.late
    assert scheduler.answers() == ["known"]
    assert not scheduler.due


@pytest.fixture
def apart():
    worker = ProcessWorker(PLAN, SENSOR)
    yield worker
    worker.close()


def ask(scheduler, samples, kind=FitKind.ADVISE):
    scheduler.add(samples)
    scheduler.request(RequestFit(kind, 0.0))
    return scheduler.answers()


def test_a_process_of_its_own_gives_the_same_bits(poses, apart):
    found = ask(FitScheduler(PLAN, SENSOR, lambda *_: apart), poses)
    assert found == ask(FitScheduler(PLAN, SENSOR, InlineWorker), poses)
    assert found[0].knowledge.down is not None


def test_a_process_that_died_raises_abandoned(poses, apart):
    scheduler = FitScheduler(PLAN, SENSOR, lambda *_: apart)
    ask(scheduler, poses)
    os.kill(apart.pid, signal.SIGKILL)
    with pytest.raises(Abandoned, match="the process that computes the fits was killed by signal 9"):
        ask(scheduler, poses)


def test_an_exception_of_a_fit_is_raised_with_its_answer(poses, apart):
    scheduler = FitScheduler(PLAN, SENSOR, lambda *_: apart)
    with pytest.raises(ValueError) as raised:
        ask(scheduler, replace(poses, acc=poses.acc[:5]))
    assert "in the process of the fits" in raised.value.__notes__[0]


def test_a_process_ends_with_the_program_that_began_it():
    command = [sys.executable, "-m", "mpucal.session.live_scheduler"]
    assert subprocess.run(command, stdin=subprocess.DEVNULL, check=False).returncode == 0
