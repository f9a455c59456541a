"""Fixtures: a session's outputs, the views that they lead to, and a keyboard."""

import math
import os

import numpy as np
import pytest

from mpucal.session import events
from mpucal.session.attitude import straight
from mpucal.terminal.view import View

CORNER = (0.58, -0.57, 0.58)


def meter(t_s, still=True, down=(0.0, 0.0, -1.0), what="", wanted=None):
    attitude, there = (straight((-np.array(d) / np.linalg.norm(d)).tolist()) for d in (down, wanted or down))
    missing = (
        {} if wanted is None else {"missing_deg": 61.0, "turn": "60 deg more, roll it to the left", "wanted": there}
    )
    return events.Meter(t_s, 0.4 if still else 1.6, still, what, down, 2.0, 199.97, 31.25, attitude, **missing)


def knowledge(t_s, down=CORNER, doubt=""):
    return events.Knowledge(
        t_s,
        gain_pct=(0.2, 0.31, 0.1),
        misalignment_deg=(0.5, 0.2, 1e3),
        bias_mg=(3.0, 2.0, 5.0),
        target=events.Target(0.1, 0.05, 1.0),
        gain=(0.5, 0.3, 1.0),
        misalignment=(0.1, 0.25, 0.0),
        bias=(1.0, 1.0, 1.0),
        overall=0.0,
        down=down,
        words="corner +x -y +z down",
        doubt=doubt,
    )


LAY_FLAT = events.Prompt(events.PromptKind.LAY_FLAT, "Lay the board flat on a firm surface and let go of it.")
TURN = events.Prompt(
    events.PromptKind.ROTATE,
    "Turn the board: on its corner between pin edge and right edge (+X -Y +Z), then hold it still.",
    CORNER,
)
VERIFY = events.Prompt(events.PromptKind.VERIFY, "Now show it this side.", (0.0, 1.0, 0.0))
REST = events.Prompt(events.PromptKind.REST, "You can put the board down.")

LAID = [
    LAY_FLAT,
    meter(10.0),
    events.Progress(10.0, 3.0, 10.0, "still for 3 of 10 s"),
    events.Countdown(10.0, 6.6, 10.0, False),
]
TURNED = [
    *LAID,
    events.Decision("flat and still for 10 s: done"),
    TURN,
    *(events.Seen(20.0 + k, k + 1, (math.cos(k), math.sin(k), 0.5 * (-1) ** k), True) for k in range(4)),
    events.Seen(24.5, 1, (0.0, 0.6, -0.8), False),
    knowledge(25.0),
    events.Progress(25.0, 5.0, 10.0, "orientation 5 of 10", 21.0),
    events.Caution(25.0, "too_fast", "turned at 480 deg/s, close to the gyroscope's range", "turn it more slowly"),
    meter(25.25, still=False, down=(0.1, -0.2, 0.97), what="turning at 30 deg/s about z", wanted=CORNER),
]
CHECKED = [
    *TURNED,
    VERIFY,
    events.Verification(40.0, 1, 2, (0.0, 1.0, 0.0), 0.004, 0.003, 0.02, 0.03, True, "orientation 1 of 2 agrees"),
    meter(40.25),
]
ENDED = [*CHECKED, REST, events.Decision("the calibration is good")]


@pytest.fixture(
    params=[[], LAID, TURNED, CHECKED, ENDED], ids=["connecting", "laid flat", "turned", "checked", "ended"]
)
def any_view(request):
    return view_of(request.param)


def view_of(outputs):
    view = View()
    for output in outputs:
        view = view.after(output)
    return view


@pytest.fixture
def views():
    """Return the views by step of the session."""
    return {
        name: view_of(outputs)
        for name, outputs in (("laid", LAID), ("turned", TURNED), ("checked", CHECKED), ("ended", ENDED))
    }


@pytest.fixture
def session():
    """Return a whole session's outputs."""
    return ENDED


@pytest.fixture
def keyboard():
    """Yield a file to type into, and the file that the program reads."""
    reader, writer = os.pipe()
    with os.fdopen(reader) as lines, os.fdopen(writer, "w") as typed:
        yield typed, lines
