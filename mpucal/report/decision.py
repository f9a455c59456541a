"""What to do with a calibration now, and for how long it holds."""

from __future__ import annotations

from ..chip.families import family_of
from ..result.calibration import REFUSED, USABLE, Calibration
from .elements import escape, pair, quantity, section

TO_SINKS = (
    ("a bridge's memory", "mpucal write calibration.json bridge --serial PORT"),
    ("the chip's offset registers (bias alone)", "mpucal write calibration.json chip --bus /dev/i2c-1"),
    ("other programs", "mpucal export calibration.json --to FORMAT"),
)
TO_AUTOPILOT = (("the autopilot's parameters", "mpucal write calibration.json autopilot --mavlink URL"),)
RESERVED = "Weigh the reservations above; to be without them, do what they say, and repeat the session."
IN_PYTHON = ("Python", 'a = mpucal.Calibration.load("calibration.json").apply(y)')
IN_FIRMWARE = ("firmware, beside calibration.bin", "mpucal export calibration.json --to c-header")


def what_now(c: Calibration) -> str:
    """What to do, for each place the calibration can go to, and what it holds for."""
    if c.verdict == REFUSED:
        return section("What to do now", _list(["Do what the reasons above say, and repeat the session."]))
    first = [RESERVED] if c.verdict == USABLE else []
    places = TO_AUTOPILOT if c.extra.get("autopilot") else (IN_PYTHON, IN_FIRMWARE, *TO_SINKS)
    uses = [f"For {escape(where)}: <code>{escape(how)}</code>" for where, how in places]
    now, later = section("What to do now", _list([*first, *uses])), section("For how long it holds", _list(_holds(c)))
    return pair(now, later)


def _holds(c: Calibration) -> list[str]:
    sheet, warm = family_of(c.sensor.chip), quantity(c.sensor.temperature_c, "°C", digits=3)
    drift = "" if sheet is None else f" ({escape(sheet.zero_g_drift)} by the data sheet)"
    at = f", {escape(warm)}" if warm else ""
    near = f"Near the temperature it was made at{at}: the bias moves with it{drift}."
    return [
        "Between the temperatures that were measured." if c.follows_temperature else near,
        "As long as nothing happens to the chip: soldering, a bent board, a shock or another mounting may change it.",
        "When in doubt: <code>mpucal check calibration.json --bus /dev/i2c-1</code>.",
    ]


def _list(items: list[str]) -> str:
    return "<ul>\n" + "".join(f"<li>{item}</li>\n" for item in items) + "</ul>\n"
