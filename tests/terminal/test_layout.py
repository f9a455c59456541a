import re
from dataclasses import replace

import pytest

from mpucal.session.events import Progress, Prompt, PromptKind, Seen
from mpucal.terminal.layout import lines
from mpucal.terminal.letters import ASCII, UNICODE

SIZES = [(80, 24), (160, 50), (60, 20), (100, 30), (40, 12), (20, 5), (1, 1)]
BRAILLE = re.compile("[\u2801-\u28ff]")


def text_of(view, columns=80, rows=24, glyphs=UNICODE):
    return [line.plain for line in lines(view, columns, rows, glyphs)]


@pytest.mark.parametrize("glyphs", [UNICODE, ASCII], ids=["unicode", "ascii"])
def test_the_screen_is_filled_and_never_overflows(any_view, glyphs):
    for columns, rows in SIZES:
        drawn = text_of(any_view, columns, rows, glyphs)
        assert len(drawn) == rows, (columns, rows)
        assert max(map(len, drawn)) <= columns, (columns, rows)


@pytest.mark.parametrize("size", [(80, 24), (160, 50)], ids=["80x24", "160x50"])
def test_all_that_a_person_needs_is_there(views, size):
    drawn = "\n".join(text_of(views["turned"], *size))
    for words in (
        "200.0 Hz",
        "31.2 °C",
        "0:15",
        "Turn the board: on its corner between pin edge and right edge (+X -Y +Z), then",
        "hold it still.",
        "now",
        "turn it like this",
        "+Z up",
        "-Z up",
        "✓✓✓✓✓◎····  5 of 10, about 20 s more.",
        "turning at 30 deg/s about z",
        "y ±0.31 %",
        "z not observable",
        "target 0.05",
        "! Turned at 480 deg/s, close to the gyroscope's range",
        "→ Turn it more slowly.",
        "q or Ctrl-C: stop",
        "█████",
    ):
        assert words in drawn
    assert BRAILLE.search(drawn)


def test_a_narrow_screen_shortens_bars_and_keys_and_cuts_no_number(views):
    turned = "\n".join(text_of(views["turned"], 60, 24))
    for words in ("turning at 30 deg/s about z", "(target 0.05)", " like this ", "q: stop"):
        assert words in turned
    before = replace(views["turned"], knowledge=None, progress=Progress(25.0, 1.0, 10.0, "orientation 1 of 10"))
    for columns in (60, 59, 40, 30):
        assert any(line.endswith("orientation 1 of 10") for line in text_of(before, columns, 24)), columns
    noted = before.noted("a sentence that is somewhat longer than what a narrow screen shows of it")
    assert any(line.endswith(" ...") for line in text_of(noted, 60, 24))


def test_replaced_characters_keep_the_styles_in_their_places(views):
    rows = [row for row in lines(views["turned"], 80, 24, ASCII) if "+-" in row.plain]
    assert [row.plain[row.spans[-1].start :][:9] for row in rows] == ["  (target"] * 2


def test_a_low_screen_shows_the_words_without_a_picture(views):
    drawn = text_of(views["turned"], 40, 12)
    assert not BRAILLE.search("".join(drawn))
    assert "ROLL LEFT 60" in drawn[1]
    assert "Turn the board: on its corner" in drawn[2]


@pytest.mark.parametrize(
    ("progress", "shown"),
    [
        (Progress(25.0, 5.0, 6.0, "orientation 5 of 6"), "xxxxxO  5 of 6."),
        (
            Progress(25.0, 9.0, 10.0, "orientation 9 of 10 (bars full; more sides confirm them)", 14.9),
            "xxxxxxxxxO  9 of 10, about 10 s more (bars full; more sides confirm them).",
        ),
        (
            Progress(25.0, 10.0, 10.0, "12 orientations, of at least 10 (bars full, but too similar)"),
            "xxxxxxxxxx  12 orientations, of at least 10 (bars full, but too similar).",
        ),
    ],
    ids=["count", "reason", "long"],
)
def test_the_finish_line_has_a_mark_for_each_orientation(views, progress, shown):
    seen = tuple(Seen(float(number), number, (1.0, 0.0, 0.0), True) for number in range(2, 13))
    drawn = text_of(replace(views["turned"], progress=progress, seen=seen), glyphs=ASCII)
    assert drawn[8].strip().startswith(shown)
    assert not any(
        "xxxx" in line for line in text_of(views["turned"].after(Prompt(PromptKind.REST, "Done.")), glyphs=ASCII)
    )
