"""Objections to a write without a person: not verified, or predicted to be no better than the old state."""

import sys
from contextlib import contextmanager
from dataclasses import replace
from types import MappingProxyType, SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.cli.person import ask_in_doubt
from mpucal.errors import WriteBackError
from mpucal.result.calibration import Calibration
from mpucal.result.comparison import is_better, worst_magnitude_error
from mpucal.sinks.kind import Device, SinkKind
from mpucal.sinks.sink import Applied
from mpucal.sinks.write_back import write_objection, write_to_all

VERIFIED = {"verification": {"agrees": True, "orientations": []}}
KIND = SinkKind("made", behind=lambda source: True, where="the made-up sink", holds="all", opener="made_up_sink:opened")


class Place:
    """A place that finds what it holds as good, or not."""

    where = "the place of the test"

    def __init__(self, against=None):
        self.against, self.written = against, False

    def keep(self, folder):
        return ()

    def reason_to_keep(self, calibration):
        return self.against

    def write(self, calibration):
        self.written = True
        return Applied(calibration, "it is written")


def calibration(verification):
    quality = {"verdict": "usable", "reasons": [], **verification}
    return Calibration(np.eye(3), np.zeros(3), quality=MappingProxyType(quality))


@pytest.mark.parametrize(
    ("verification", "against", "why"),
    [
        (VERIFIED, None, None),
        (VERIFIED, "what it holds is as good", "as good"),
        ({}, None, "not verified"),
        ({"verification": {"agrees": None, "orientations": []}}, None, "not verified"),
    ],
    ids=["verified", "as good", "no verification", "a verification that nobody finished"],
)
def test_without_a_person_only_what_is_verified_and_better_is_written(
    monkeypatch, tmp_path, verification, against, why
):
    place = Place(against)

    @contextmanager
    def opened(_device):
        yield place

    monkeypatch.setitem(sys.modules, "made_up_sink", SimpleNamespace(opened=opened))
    device = Device(None, "made-up", lambda: None, print)
    made = calibration(verification)

    def write():
        return list(
            write_to_all(
                (KIND,),
                made,
                device,
                tmp_path,
                lambda kind, now: now,
                lambda question: None,
                in_doubt=lambda question: ask_in_doubt(question, yes=True),
            )
        )

    if why is None:
        write()
    else:
        assert why in write_objection(made, place)
        with pytest.raises(WriteBackError, match=f"nothing was changed: .*{why}") as raised:
            write()
        assert raised.value.exit_code == 6
    assert place.written is (why is None)


@settings(max_examples=100)
@given(scale=st.floats(-0.05, 0.05), bias=st.floats(-0.5, 0.5), axis=st.integers(0, 2))
def test_what_is_left_wrong_is_the_worst_over_attitudes(scale, bias, axis):
    D, b_a = np.eye(3), np.zeros(3)
    D[axis, axis] += scale
    b_a[axis] = bias
    true = replace(calibration({}), D=D, b_a=b_a, fit={"gravity": 9.8})
    points = np.random.default_rng(0).normal(size=(4000, 3))
    points = np.vstack([np.eye(3), -np.eye(3), points])
    f = 9.8 * points / np.linalg.norm(points, axis=1, keepdims=True)
    worst = np.abs(np.linalg.norm(f @ D.T + b_a, axis=1) - 9.8).max()
    assert worst <= worst_magnitude_error(true, np.eye(3), np.zeros(3)) + 1e-9
    # along the axis of both errors the bound is met
    assert worst == pytest.approx(9.8 * abs(scale) + abs(bias), abs=0.02)


def test_an_equal_one_is_not_better_and_neither_is_chance():
    assert is_better(0.01, 0.05, 0.01)
    assert not is_better(0.05, 0.05, 0.0)
    assert not is_better(0.0, 0.014, 0.01)
