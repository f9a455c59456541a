"""A computer that stops for 5 s, or is set to another day: a vehicle's session goes on, with a marked gap."""

import sys
from importlib import import_module
from pathlib import Path
from time import time_ns
from unittest.mock import patch

import numpy as np
import pytest

import mpucal
from mpucal.__main__ import run
from mpucal.mavlink.transport import Clock

STOPPED_S = 5.0
DAY_NS = 86_400 * 10**9


@pytest.fixture(scope="module")
def worlds():
    sys.path.insert(0, str(Path(__file__).parents[1] / "tools"))
    yield import_module("campaign_worlds")
    del sys.path[0]


def pass_by(world, seconds):
    """The computer does nothing meanwhile; what a vehicle sends is lost."""
    transport = world.transport
    transport._vehicle.go_on(transport._vehicle.now_us + round(seconds * 1e6))


def test_a_session_goes_on_where_time_passed_it_by(worlds, tmp_path):
    world = worlds.World(worlds.VEHICLE)
    world.moments.add(24.0, lambda: pass_by(world, STOPPED_S))
    days = iter(range(1, 1_000_000))
    with world.opened(), patch("time.time_ns", lambda: time_ns() + (-1) ** next(days) * DAY_NS):
        code = run(
            [
                "session",
                "--mavlink",
                "sim:seed=3",
                "--no-write",
                "-o",
                str(tmp_path / "board"),
                "--yes",
            ]
        )
    assert code == 0
    recording = mpucal.load(tmp_path / "board")
    steps = np.diff(recording.t)
    assert steps.max() == pytest.approx(STOPPED_S, abs=2)
    assert recording.gap[1:][steps > 0.5].all()


def test_the_time_of_a_link_never_follows_who_sets_the_clock():
    clock = Clock()
    begun_ns = clock.now_ns()
    for jump_ns in (DAY_NS, -DAY_NS):
        with patch("time.time_ns", lambda jump_ns=jump_ns: time_ns() + jump_ns):
            assert 0 <= clock.now_ns() - begun_ns < DAY_NS // 2
