"""The voice: one sentence at a time, and none that is out of date within a second."""

from mpucal.session.events import Caution, Countdown, Held, Meter, Prompt, PromptKind, Use
from mpucal.terminal.view import View
from mpucal.terminal.voice import Tone, Voice

FLAT = (1.0, 0.0, 0.0, 0.0)
SIDE, OTHER = (
    Prompt(PromptKind.ROTATE, f"Turn the board: on its {edge} edge, then hold it still.", (x, 0.0, 0.0))
    for edge, x in (("left", -1.0), ("right", 1.0))
)


def meter(t_s, missing_deg, turn="", still=False):
    return Meter(t_s, 0.3, still, "", (0.0, 0.0, -1.0), 5.0, 200.0, None, FLAT, missing_deg, turn, FLAT)


def left(t_s, degrees=60):
    return meter(t_s, float(degrees), f"{degrees} deg more, roll it to the left")


def spoken(*outputs):
    """Return what is said after these outputs: time, tone and words."""
    view, voice, said = View(), Voice(), []
    for output in outputs:
        view = view.after(output)
        voice.hear(view)
        if voice.said is not None and (not said or voice.said is not said[-1]):
            said.append(voice.said)
    assert [one.number for one in said] == list(range(len(said)))
    return [(one.t_s, one.tone, one.words) for one in said]


def held(t_s, use=Use.TAKEN):
    return Held(t_s, use, (-1.0, 0.0, 0.0), use.value)


def test_a_hold_is_turn_hold_taken_and_nothing_between():
    words = spoken(
        SIDE,
        left(1.0),
        meter(1.5, 4.0, still=True),
        meter(2.5, 4.0, still=True),
        Countdown(2.6, 1.0, 1.25, False),
        Caution(2.8, "data_lost", "samples were lost", "hold this orientation a moment longer"),
        Countdown(3.6, 0.0, 1.25, False),
        left(3.61),
        held(3.7),
        OTHER,
        left(4.0, 90),
        left(5.0, 90),
    )
    assert words == [
        (0.0, Tone.NONE, SIDE.text),
        (1.0, Tone.NONE, "60 degrees more, roll it to the left"),
        (2.5, Tone.NONE, "Hold it still"),
        (2.6, Tone.HOLD, ""),
        (3.7, Tone.TAKEN, "taken"),
        (5.0, Tone.NONE, "90 degrees more, roll it to the left"),
    ]


def test_a_bump_in_a_hold_is_not_called_wrong_and_an_abandoned_hold_is():
    begun = [SIDE, left(1.0), meter(2.1, 20.0, still=True), Countdown(2.3, 0.75, 1.25, False, elsewhere=True)]
    bump = [*begun, left(2.8, 20), left(3.0, 20)._replace(still=True), Countdown(3.0, 0.5, 1.25, False, elsewhere=True)]
    assert spoken(*bump)[2:] == [(2.3, Tone.HOLD, "New: hold still")]
    away = [*begun, left(2.8, 20), left(3.3, 40), left(4.4, 40)]
    assert spoken(*away)[3:] == [(4.4, Tone.WRONG, "40 degrees more, roll it to the left")]


def test_the_turn_is_repeated_after_a_while_and_at_once_for_another_orientation():
    words = spoken(SIDE, left(1.0), left(3.0, 40), left(6.1, 40), OTHER, left(6.3, 90), left(7.2, 90), left(8.3, 90))
    assert [(t_s, said[:2]) for t_s, _, said in words[1:]] == [(1.0, "60"), (6.1, "40"), (7.2, "90")]


def test_a_caution_is_spoken_once_and_not_late():
    caution = Caution(2.0, "too_fast", "turned too fast", "turn it more slowly")
    told = (2.0, Tone.WRONG, "turned too fast. turn it more slowly")
    assert told in spoken(SIDE, left(1.0), caution, left(2.25), left(2.5))
    late = spoken(SIDE, left(1.0), Countdown(1.9, 0.5, 1.25, False), caution, held(5.0), left(9.0))
    assert not any("too fast" in words for _, _, words in late)
