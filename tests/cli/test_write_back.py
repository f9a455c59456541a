"""A session's calibration on its way to a sink: which one, what is recorded, and what is left of a failure."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.cli import write_back
from mpucal.cli.destination import destinations, recorder, said, written_back
from mpucal.cli.write import TARGETS
from mpucal.errors import BusError, KeepsNothing, OutputError, UsageError, WriteBackError
from mpucal.files import load
from mpucal.result.calibration import Calibration
from mpucal.sinks.sink import Applied

BIAS = np.array([0.3, -0.2, 1.0])
GOOD = {"verdict": "good", "reasons": []}


@pytest.mark.parametrize(
    ("sinks", "no_write", "source", "names"),
    [
        ((), False, "bus", ()),
        ((), False, "serial", ("bridge",)),
        ((), False, "mavlink", ("autopilot",)),
        ((), False, "replay", ()),
        ((), True, "mavlink", ()),
        (("file",), False, "serial", ()),
        (("chip",), False, "bus", ("chip",)),
        (("bridge", "chip"), False, "serial", ("chip", "bridge")),
    ],
)
def test_a_session_chooses_the_sink_that_fits_its_source(sinks, no_write, source, names):
    assert destinations(sinks, no_write, {source: "x"}) == names
    assert said(names, no_write).startswith("The result goes to files")


@pytest.mark.parametrize(
    ("sinks", "no_write", "source"),
    [
        (("chip",), True, "bus"),
        (("bridge",), False, "bus"),
        (("autopilot",), False, "bus"),
        (("chip",), False, "mavlink"),
        (("chip",), False, "replay"),
    ],
)
def test_a_sink_that_is_not_there_is_wrong_usage_before_anything_begins(sinks, no_write, source):
    with pytest.raises(UsageError):
        destinations(sinks, no_write, {source: "x"})


class Registers:
    """A place that subtracts what was written, where each step may fail: keep, write, read back, put back."""

    name, where = "chip", "the chip of the test"

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
        return Applied(replace(calibration, applied_in_hardware=self.held), "it is written")

    def put_back(self, kept):
        self.held = np.array(json.loads(kept.read_text()))
        return "it holds again what it held"


class Opened:
    def __init__(self, sink):
        self.sink = sink

    def __call__(self, words):
        return self

    def __enter__(self):
        return self.sink

    def __exit__(self, *_):
        return False


@settings(deadline=None, max_examples=60)
@given(fails=st.sets(st.integers(1, 4), max_size=2), full_after=st.none() | st.integers(0, 4))
def test_the_old_state_or_the_new_one_and_the_files_say_which(tmp_path_factory, fails, full_after):
    folder = tmp_path_factory.mktemp("faults")
    measured = Calibration(np.eye(3), BIAS, quality=GOOD)
    measured.save(folder / "calibration.json")
    sink, saved = Registers(fails), []

    def record(name, now):
        if full_after is not None and len(saved) >= full_after:
            raise OutputError("cannot write calibration.json (no space left)", "make room")
        saved.append(name)
        now.save(folder / "calibration.json")
        return now

    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(TARGETS, "chip", Opened(sink))
        try:
            (applied,) = written_back(("chip",), measured, {}, True, folder, record)
        except WriteBackError:
            new = False
        else:
            new = True
            assert applied.calibration.extra["written"][0]["where"] == sink.where
    assert np.array_equal(sink.held, BIAS if new else np.zeros(3))
    # whoever reads the file subtracts what is left, and never twice
    of_file = Calibration.load(folder / "calibration.json")
    assert np.array_equal(of_file.applied_in_hardware, sink.held)
    assert new == (not fails & {1, 2, 3} and full_after != 0)


def test_a_place_that_cannot_be_restored_says_what_it_keeps(tmp_path):
    class Kept(Registers):
        put_back = None

        def keep(self, folder):
            return ()

    def record(now):
        raise OutputError("cannot write calibration.json (no space left)", "make room")

    with pytest.raises(OutputError, match="it is written, but cannot write"):
        write_back.write_to(Kept(set()), Calibration(np.eye(3), BIAS, quality=GOOD), tmp_path, record)


@pytest.mark.parametrize("verdict", ["refused", "good"])
def test_only_what_is_not_refused_is_written(tmp_path, monkeypatch, verdict):
    sink = Registers(set())
    monkeypatch.setitem(TARGETS, "chip", Opened(sink))
    calibration = Calibration(np.eye(3), BIAS, quality={"verdict": verdict, "reasons": []})
    done = list(written_back(("chip",), calibration, {}, True, tmp_path, lambda name, now: now))
    assert len(done) == (verdict == "good") == bool(sink.held.any())


def test_a_device_that_is_gone_is_a_write_back_that_failed(tmp_path, monkeypatch):
    def gone(words):
        raise BusError("there is no serial port /dev/x", "plug it in")

    monkeypatch.setitem(TARGETS, "bridge", gone)
    calibration = Calibration(np.eye(3), BIAS, quality=GOOD)
    with pytest.raises(WriteBackError, match="nothing was written to the bridge"):
        list(written_back(("bridge",), calibration, {}, True, tmp_path, lambda name, now: now))


@pytest.mark.parametrize("asked", [(), ("bridge",)], ids=["by default", "asked for"])
def test_a_bridge_that_keeps_nothing_is_a_failure_where_it_was_asked_for(tmp_path, monkeypatch, capsys, asked):
    def keeps_nothing(words):
        raise KeepsNothing("the firmware of the bridge on x keeps no calibration", "flash another")

    monkeypatch.setitem(TARGETS, "bridge", keeps_nothing)
    calibration = Calibration(np.eye(3), BIAS, quality=GOOD)
    writing = written_back(("bridge",), calibration, {}, True, tmp_path, lambda name, now: now, asked)
    if asked:
        with pytest.raises(WriteBackError):
            list(writing)
    else:
        assert list(writing) == []
        assert "in files alone" in capsys.readouterr().err


@pytest.mark.parametrize("answer", ["y\n", "n\n", None], ids=["yes", "no", "no terminal"])
def test_a_person_is_asked_and_nobody_else(monkeypatch, answer):
    monkeypatch.setattr("sys.stdin.isatty", lambda: answer is not None, raising=False)
    asked = []
    monkeypatch.setattr("click.confirm", lambda question, err: asked.append(question) or answer == "y\n")
    if answer == "n\n":
        with pytest.raises(WriteBackError, match="you said no"):
            write_back.ask("Write?", yes=False)
    else:
        write_back.ask("Write?", yes=False)
    write_back.ask("Write?", yes=True)
    assert len(asked) == (answer is not None)


def test_a_session_writes_to_the_chip_and_says_so(mpucal):
    words = (
        "session",
        "--bus",
        "sim",
        "--seed",
        "3",
        "--rate",
        "100",
        "--to",
        "chip",
        "-o",
        "board",
        "--json",
        "--yes",
    )
    result = mpucal(*words)
    assert result.code == 0, result.err
    made = Calibration.load("board/calibration.json")
    assert json.loads(result.out) == made.document()
    (entry,) = made.extra["written"]
    assert (entry["to"], entry["where"]) == ("chip", "the chip on sim")
    # one word is 0.5 mg, an even one 1 mg
    np.testing.assert_allclose(made.applied_in_hardware, made.b_a, atol=0.0055)
    np.testing.assert_array_equal(
        Calibration.load("board/calibration.bin").applied_in_hardware, np.float32(made.applied_in_hardware)
    )
    assert "offset registers" in Path("board/report.html").read_text()
    assert "The result goes to files and the chip's offset registers" in result.err
    # its own capture was measured before: all of b_a is subtracted of that
    mpucal("apply", "board/calibration.json", "board", "-o", "out.npz")
    acc = (load("board").acc - made.b_a) @ np.linalg.inv(made.D).T
    np.testing.assert_allclose(load("out.npz").acc, acc, atol=1e-12)


def test_a_recorder_keeps_what_was_measured_behind_new_parameters(tmp_path):
    measured = Calibration(np.eye(3), BIAS, quality=GOOD)
    now = replace(measured, D=2 * np.eye(3), extra={"written": [{"to": "autopilot"}]})
    held = recorder(tmp_path, measured, None, None)("autopilot", now)
    assert np.array_equal(held.D, measured.D)
    assert held.extra["written"] == [{"to": "autopilot"}]
    assert np.array_equal(Calibration.load(tmp_path / "calibration.json").D, measured.D)
    assert np.array_equal(Calibration.load(tmp_path / "calibration-on-autopilot.json").D, now.D)
