import pytest

from mpucal.session.events import Countdown, Meter, Progress, Prompt, PromptKind
from tools.lab import guidance_trials as trials


@pytest.mark.slow
@pytest.mark.parametrize("hand", ["by words", "wandering"])
def test_guidance_shown_to_a_person_is_right(hand):
    """A hand that follows only the words ends with a good calibration, and a careless one is cautioned."""
    trial = trials.of_hand((hand, 1))
    assert (trial.verdict, trial.wrong) == ("good", {})
    assert trial.holds >= 10


def test_wrong_guidance_is_counted():
    watcher = trials.Watcher()
    near, far = (1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0)
    words = "90 deg more, tip it away from you"
    meter = Meter(0.0, 0.5, True, "", (0.0, 0.0, -1.0), 1.0, 200.0, None, near, 90.0, words, near)
    for output in (
        Prompt(PromptKind.ROTATE, "One.", (1.0, 0.0, 0.0)),
        meter,
        Countdown(0.1, 1.0, 1.25, False),
        meter._replace(t_s=0.25),
        meter._replace(t_s=0.5, attitude=far, wanted=far),
        Prompt(PromptKind.ROTATE, "Another.", (0.0, 1.0, 0.0)),
        Prompt(PromptKind.ROTATE, "A third.", (0.0, 0.0, 1.0)),
        Progress(0.6, 12.0, 10.0, "orientation 12 of 10"),
    ):
        watcher.hear(output)
    assert set(+watcher.wrong) == {
        "hold far away",
        "jumps of the board",
        "jumps of the wanted one",
        "changed without a word",
        "counts above their total",
    }
