"""Writes of a calibration to a sink: the saved state, the notes in files, and the state after failures."""

import json
import sys
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.cli.common import ask_in_doubt
from mpucal.errors import BusError, NoStorage, OutputError, WriteBackError
from mpucal.result.calibration import Calibration
from mpucal.sinks.kind import Applied, Device, Effect, Sink, SinkKind
from mpucal.sinks.table import SINKS
from mpucal.sinks.write_back import put_back, session_recorder, write_objection, write_to, write_to_all

BIAS = np.array([0.3, -0.2, 1.0])


def measured(**quality):
    return Calibration(np.eye(3), BIAS, quality={"verdict": "good", "reasons": [], **quality})


class Registers(Sink):
    """Sink that subtracts the written bias, of which each step may fail: keep, write, read back, put back."""

    where = "the chip of the test"

    def __init__(self, fails):
        self.held, self.fails, self.steps = np.zeros(3), fails, 0

    def _step(self):
        self.steps += 1
        if self.steps in self.fails:
            raise BusError("a transfer broke off", "check the wires")

    def keep(self, folder):
        self._step()
        (folder / "old").write_text(json.dumps(self.held.tolist()))
        return (folder / "old",)

    def write(self, calibration):
        old = self.held
        try:
            self._step()
            self.held = calibration.b_a
            self._step()
        except BusError as error:
            self.held = old
            raise WriteBackError(f"{error.what}; the old state holds", error.remedy) from error
        return Applied(replace(calibration, applied_in_hardware=self.held), ("it is written",))

    def put_back(self, kept):
        self.held = np.array(json.loads(kept.read_text()))
        return "it holds again what it held"


KIND = SinkKind(
    "made",
    fits=lambda source: True,
    where="the made-up sink",
    holds="all",
    opener="made_up_sink:opened",
    effect=Effect.LESS_BIAS,
)


def write_all(monkeypatch, sink, calibration, folder, record, asked=(), said=print, in_doubt=None):
    """Write to a made-up sink, or what is raised where it is opened."""

    @contextmanager
    def opened(_device):
        if isinstance(sink, Exception):
            raise sink
        yield sink

    monkeypatch.setitem(sys.modules, "made_up_sink", SimpleNamespace(opened=opened))
    device = Device(None, "/dev/made-up", lambda: None, said)
    return list(write_to_all((KIND,), calibration, device, folder, record, lambda question: None, asked, in_doubt))


def unsaved(kind, now):
    raise OutputError("cannot write calibration.json (no space left)", "make room")


def as_it_is(kind, now):
    return now


@settings(max_examples=50)
@given(fails=st.sets(st.integers(1, 4), max_size=2), full_after=st.none() | st.integers(0, 4), memory=st.booleans())
def test_a_failure_leaves_the_old_or_the_new_state_and_files_that_agree(tmp_path_factory, fails, full_after, memory):
    folder = tmp_path_factory.mktemp("faults")
    calibration = measured()
    calibration.save(folder / "calibration.json")
    sink, saved = Registers(fails), []

    def record(kind, now):
        if full_after is not None and len(saved) >= full_after:
            if not memory:
                raise MemoryError
            unsaved(kind, now)
        saved.append(kind.name)
        now.save(folder / "calibration.json")
        return now

    with pytest.MonkeyPatch.context() as patch:
        try:
            (applied,) = write_all(patch, sink, calibration, folder, record)
        except WriteBackError:
            new = False
        else:
            new = True
            assert applied.calibration.extra["written"][0]["where"] == sink.where
    assert np.array_equal(sink.held, BIAS if new else np.zeros(3))
    # readers of the file subtract only the rest of the bias
    of_file = Calibration.load(folder / "calibration.json")
    assert np.array_equal(of_file.applied_in_hardware, sink.held)
    assert new == (not fails & {1, 2, 3} and full_after != 0)


def test_a_place_that_cannot_be_restored_says_what_it_keeps_and_takes_calibrations_alone(tmp_path):
    sink, kind = Registers(set()), KIND._replace(effect=Effect.NONE)
    sink.put_back = partial(Sink.put_back, sink)
    with pytest.raises(WriteBackError, match="old is not a calibration"):
        put_back(kind, sink, tmp_path / "old", tmp_path, print)
    assert sink.steps == 0
    with pytest.raises(OutputError, match="it is written, but cannot write"):
        write_to(kind, sink, measured(), tmp_path, unsaved, print)


def test_a_device_without_storage_fails_only_if_it_was_asked_for(tmp_path, monkeypatch):
    sink, said = Registers(set()), []
    assert write_all(monkeypatch, sink, measured(verdict="refused"), tmp_path, as_it_is) == []
    assert not sink.held.any()
    gone = BusError("there is no serial port /dev/x", "plug it in")
    with pytest.raises(WriteBackError, match="nothing was written to the made-up sink: there is no serial port"):
        write_all(monkeypatch, gone, measured(), tmp_path, as_it_is)
    # a device that keeps nothing is a failure only where it was asked for
    keeps_nothing = NoStorage("the firmware of the bridge on x keeps no calibration", "flash another")
    assert write_all(monkeypatch, keeps_nothing, measured(), tmp_path, as_it_is, said=said.append) == []
    assert "only in files" in said[0]
    with pytest.raises(WriteBackError):
        write_all(monkeypatch, keeps_nothing, measured(), tmp_path, as_it_is, ("made",))


@pytest.mark.parametrize(
    ("verification", "reason", "objection"),
    [
        ({"verification": {"agrees": True, "orientations": []}}, None, None),
        ({"verification": {"agrees": True, "orientations": []}}, "what it holds is as good", "as good"),
        ({}, "it holds other data", "not verified in new orientations; it holds other data"),
        ({"verification": {"agrees": None, "orientations": []}}, None, "not verified"),
    ],
    ids=["verified", "as good", "two reasons", "a verification that nobody finished"],
)
def test_without_a_person_only_what_is_verified_and_better_is_written(
    monkeypatch, tmp_path, verification, reason, objection
):
    sink, calibration = Registers(set()), measured(**verification)
    sink.reason_to_keep = lambda calibration: reason
    write = partial(
        write_all, monkeypatch, sink, calibration, tmp_path, as_it_is, in_doubt=partial(ask_in_doubt, yes=True)
    )
    if objection is None:
        write()
    else:
        assert objection in write_objection(calibration, sink)
        with pytest.raises(WriteBackError, match=f"nothing was changed: .*{objection}") as raised:
            write()
        assert raised.value.exit_code == 6
    assert bool(sink.held.any()) is (objection is None)


def test_the_measured_calibration_is_kept_beside_that_of_the_new_stream(tmp_path):
    first = measured()
    now = replace(first, D=2 * np.eye(3), extra={"written": [{"to": "autopilot"}]})
    held = session_recorder(tmp_path, first, None, None)(SINKS["autopilot"], now)
    assert np.array_equal(held.D, first.D)
    assert held.extra["written"] == [{"to": "autopilot"}]
    assert np.array_equal(Calibration.load(tmp_path / "calibration.json").D, first.D)
    assert np.array_equal(Calibration.load(tmp_path / "calibration-on-autopilot.json").D, now.D)
