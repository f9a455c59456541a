from dataclasses import replace

import pytest

from mpucal.session.events import Countdown, Held, Progress, Seen, Use


def test_the_headline_is_the_instruction(views):
    assert views["laid"].headline == "STILL 7"
    assert views["turned"].headline == "ROLL LEFT 60"
    assert views["checked"].headline == "CHECK"
    assert views["ended"].headline == "PUT IT DOWN"


COUNTDOWNS = {
    "not begun": (Countdown(26.0, 2.0, 2.0, False), "ROLL LEFT 60"),
    "runs": (Countdown(26.0, 1.3, 2.0, False), "HOLD 2"),
    "runs elsewhere": (Countdown(26.0, 1.3, 2.0, False, elsewhere=True), "NEW: HOLD 2"),
    "perhaps elsewhere": (Countdown(26.0, 1.75, 2.0, False, elsewhere=True), "ROLL LEFT 60"),
    "paused": (Countdown(26.0, 1.3, 2.0, True), "ROLL LEFT 60"),
    "over": (Countdown(24.5, 0.0, 2.0, False), "HOLD"),
    "over without a word": (Countdown(23.5, 0.0, 2.0, False), "ROLL LEFT 60"),
    "forgotten": (Countdown(20.0, 1.3, 2.0, False), "ROLL LEFT 60"),
}


@pytest.mark.parametrize(("countdown", "headline"), COUNTDOWNS.values(), ids=COUNTDOWNS)
def test_a_countdown_that_runs_is_the_headline(views, countdown, headline):
    view = replace(views["turned"], now_s=26.0, countdown=countdown)
    assert view.headline == headline


def test_a_countdown_ends_when_the_board_moves_or_the_orientation_is_decided(views):
    counting = replace(views["turned"], now_s=26.0, countdown=Countdown(26.0, 1.3, 2.0, False))
    bumped = counting.after(counting.meter._replace(t_s=26.2, still=False))
    assert bumped.headline == "HOLD 2"
    assert bumped.after(counting.meter._replace(t_s=26.5, still=False)).headline == "ROLL LEFT 60"
    assert counting.after(counting.meter._replace(t_s=26.2, still=True)).headline == "HOLD 2"
    assert counting.after(Held(26.2, Use.TAKEN, (1.0, 0.0, 0.0), "taken")).headline == "TAKEN"


def test_an_orientation_is_ticked_as_it_is_taken(views):
    """Follow a hold as a session does: the progress counts it at its beginning, and it is seen before its end."""
    view = replace(views["turned"], seen=(), countdown=None)
    ticked = []
    for output in (
        Progress(30.0, 2.0, 10.0, "orientation 2 of 10"),
        Countdown(30.5, 1.5, 2.0, False),
        Seen(31.0, 2, (1.0, 0.0, 0.0), True),
        Countdown(31.5, 0.5, 2.0, False),
        Held(32.0, Use.TAKEN, (1.0, 0.0, 0.0), "taken"),
    ):
        view = view.after(output)
        ticked.append(view.line)
    assert ticked == [(1, 10)] * 4 + [(2, 10)]


@pytest.mark.parametrize(
    ("use", "headline"), [(Use.TAKEN, "TAKEN"), (Use.USEFUL, "NOT THAT ONE, BUT USEFUL"), (Use.SEEN, "SEEN ALREADY")]
)
def test_the_use_of_an_orientation_is_the_headline_for_a_moment(views, use, headline):
    held = Held(26.0, use, (1.0, 0.0, 0.0), "")
    view = views["turned"].after(held)
    assert view.headline == headline
    assert (replace(view, now_s=26.6).headline == headline) == (use is not Use.TAKEN)
    assert replace(view, now_s=28.0).headline == "ROLL LEFT 60"
