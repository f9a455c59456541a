"""Makes docs/reasons.md from the table in mpucal/reasons.py."""

from __future__ import annotations

import re

from mpucal.reasons import KINDS, Kind, Sentence

HEAD = """# The reasons against a calibration

The verdict of a calibration is *good* if nothing speaks against it. Otherwise `quality.reasons` in `calibration.json`
lists what does: `code`, `message` (what is wrong and what to do) and `remedy` (what to do). A reason that refuses the
calibration makes the verdict *refused*, the others make it *usable*. Codes never change their meaning; new ones may
come.

This page is made by `python -m tools.make pages` from the table in `mpucal/reasons.py`; … stands for a number or a
name. Every reason can be seen without a board: by a session on the simulated chip, or by spoiling a good recording:

    from dataclasses import replace
    import mpucal
    r = mpucal.load("fixtures/sessions/mpu6050.mcap")
"""
REFUSES = {"always": "It always refuses the calibration.", "never": "It never refuses the calibration."}


def page(_old: str) -> str:
    """The whole page."""
    overview = ["| code | what it means | refuses |", "|---|---|---|"]
    overview += [f"| [`{code}`](#{code}) | {kind.meaning} | {kind.refuses} |" for code, kind in KINDS.items()]
    return "\n".join([HEAD, *overview, *(line for code, kind in KINDS.items() for line in _section(code, kind))]) + "\n"


def _section(code: str, kind: Kind) -> list[str]:
    refuses = f"It refuses the calibration where {kind.refused_when}." if kind.refused_when else REFUSES[kind.refuses]
    rows = [_row(sentence) for sentence in kind.sentences.values()]
    again = " Turning the board again from the start may help." if kind.turn_again else ""
    return [
        *("", f"## {code}", ""),
        *(f"{kind.meaning} {refuses}{again}", ""),
        *("| what is wrong | what to do |", "|---|---|", *rows),
        *("", "To see it:", "", f"    {kind.reproduce}"),
    ]


def _row(sentence: Sentence) -> str:
    # a | would end the cell
    cells = (re.sub(r"\{[^}]*\}", "…", text).replace("|", "\\|") for text in (sentence.what, sentence.remedy))
    return f"| {' | '.join(cells)} |"
