import contextlib
import io
import json
import math
import os
from dataclasses import replace

import pytest

from mpucal.session.events import Caution, Decision, Progress, Prompt, PromptKind
from mpucal.terminal.keys import Keys
from mpucal.terminal.lines import JsonLines, Lines


@pytest.fixture
def out():
    return io.StringIO()


def test_a_prompt_that_goes_on_is_a_line(out):
    lines = Lines(out, Keys())
    lines.hear(Prompt(PromptKind.ROTATE, "Now turn it."))
    lines.hear(Prompt(PromptKind.ROTATE, "Turn it: +X down.", (1.0, 0.0, 0.0)))
    assert out.getvalue().endswith("\n\n  Turn it: +X down.\n")
    assert out.getvalue().count("TURN IT") == 1


def test_the_bell_rings_at_new_prompts_only(out):
    lines = Lines(out, Keys(), bell=True)
    for text in ("Now turn it.", "Now turn it.", "Now the other side."):
        lines.hear(Prompt(PromptKind.ROTATE, text))
    assert out.getvalue().count("\a") == 2
    silent = io.StringIO()
    Lines(silent, Keys()).hear(Prompt(PromptKind.ROTATE, "Now turn it."))
    assert "\a" not in silent.getvalue()


def test_progress_comes_once_a_second_at_most(out):
    lines = Lines(out, Keys())
    for k in range(40):
        lines.hear(Progress(100.0 + 0.25 * k, k, 40, f"step {k}"))
    assert out.getvalue().split() == [word for k in range(0, 40, 4) for word in ("step", str(k))]


def test_the_same_warning_is_not_repeated_at_once(out):
    lines = Lines(out, Keys())
    for t_s, code in ((1.0, "too_fast"), (2.0, "too_fast"), (2.5, "clipped"), (6.5, "too_fast")):
        lines.hear(Caution(t_s, code, f"{code} at {t_s}", "turn more slowly"))
    assert out.getvalue().splitlines() == [
        "  ! Too_fast at 1.0. Turn more slowly.",
        "  ! Clipped at 2.5. Turn more slowly.",
        "  ! Too_fast at 6.5. Turn more slowly.",
    ]


def test_a_whole_session_is_told(out, session):
    lines = Lines(out, Keys())
    for output in session:
        lines.hear(output)
    said = out.getvalue()
    for words in (
        "LAY FLAT",
        "still for 3 of 10 s",
        "1 sigma: scale factor error ±0.31 % (target 0.1), misalignment not observable (target 0.05), bias ±3 mg",
        "Turn it more slowly.",
        "CHECK",
        "orientation 1 of 2 agrees",
        "the calibration is good",
    ):
        assert words in said
    assert "\x1b" not in said


def test_keys_are_explained_once_if_there_is_a_keyboard(keyboard):
    for lines_of, times in ((None, 0), (keyboard[1], 1)):
        out = io.StringIO()
        lines = Lines(out, Keys(lines_of))
        for kind in (PromptKind.LAY_FLAT, PromptKind.ROTATE):
            lines.hear(Prompt(kind, "Do it."))
        assert out.getvalue().count("Enter: skip ahead") == times


def test_every_event_is_a_line_of_json(out, session):
    lines = JsonLines(out, Keys())
    for output in session:
        lines.hear(output)
    events = [json.loads(line) for line in out.getvalue().splitlines()]
    assert [event["event"] for event in events] == [type(output).__name__.lower() for output in session]
    assert next(event for event in events if event["event"] == "prompt") == {
        "event": "prompt",
        "kind": "lay_flat",
        "text": session[0].text,
        "down": None,
    }
    decision = Decision("enough", "start again")
    lines.hear(decision)
    assert json.loads(out.getvalue().splitlines()[-1]) == {
        "event": "decision",
        "why": "enough",
        "remedy": "start again",
    }


def test_json_knows_no_infinity(out, session):
    told = next(output for output in session if type(output).__name__ == "Knowledge")
    JsonLines(out, Keys()).hear(replace(told, gain_pct=(math.inf, math.nan, 0.1)))
    assert json.loads(out.getvalue())["gain_pct"] == [None, None, 0.1]


def test_a_session_whose_listener_left_goes_on():
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "w", buffering=1) as pipe:
        lines = Lines(pipe, Keys())
        for k in range(3):
            lines.say(f"line {k}")
        with contextlib.suppress(BrokenPipeError):
            pipe.close()
