import contextlib
import io
import json
import os

import pytest

from mpucal.session.events import Decision, Prompt, PromptKind
from mpucal.terminal.console import JsonLines, Lines
from mpucal.terminal.keys import Keys


@pytest.fixture
def out():
    return io.StringIO()


def test_the_bell_rings_at_new_prompts_only(out):
    lines = Lines(out, Keys(), bell=True)
    for text in ("Now turn it.", "Now turn it.", "Now the other side."):
        lines.hear(Prompt(PromptKind.ROTATE, text))
    assert out.getvalue().count("\a") == 2
    silent = io.StringIO()
    Lines(silent, Keys()).hear(Prompt(PromptKind.ROTATE, "Now turn it."))
    assert "\a" not in silent.getvalue()


def test_a_whole_session_is_printed(out, session):
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


def test_a_session_continues_after_its_output_pipe_is_closed():
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "w", buffering=1) as pipe:
        lines = Lines(pipe, Keys())
        for k in range(3):
            lines.say(f"line {k}")
        with contextlib.suppress(BrokenPipeError):
            pipe.close()
