"""Wording of uncertainties and cautions, on the screen and in lines."""

from __future__ import annotations

from dataclasses import dataclass

from ..report.units import UNKNOWN
from ..session.events import Direction, Knowledge, Progress


@dataclass(frozen=True)
class Group:
    """Parameters of one kind, for x, y and z: progress 0..1, standard uncertainties (1 sigma), and their target."""

    name: str
    unit: str
    progress: Direction
    std: Direction
    target: float

    @property
    def worst(self) -> int:
        """Index of the axis that is farthest from its target."""
        return min(range(3), key=lambda i: self.progress[i])

    def text(self, axis: int) -> str:
        """Return the uncertainty of an axis with its unit."""
        return f"±{rounded(self.std[axis])} {self.unit}" if self.std[axis] < UNKNOWN else "not observable"


def groups(k: Knowledge) -> tuple[Group, Group, Group]:
    """Return the groups scale factor error, misalignment and bias."""
    return (
        Group("scale factor error", "%", k.gain, k.gain_pct, k.target.gain_pct),
        Group("misalignment", "deg", k.misalignment, k.misalignment_deg, k.target.misalignment_deg),
        Group("bias", "mg", k.bias, k.bias_mg, k.target.bias_mg),
    )


def known(k: Knowledge) -> str:
    """Return the largest uncertainty of each group, and its target, as text."""
    text = ", ".join(f"{g.name} {g.text(g.worst)} (target {g.target:g})" for g in groups(k))
    return f"1 sigma: {text}" + (f"; {k.doubt}" if k.doubt else "")


def rounded(value: float) -> str:
    """Return a number with two digits, and no exponent."""
    return f"{value:.0f}" if value >= 10.0 else f"{value:.2g}"


def count(p: Progress) -> str:
    """Return the progress as text, with the time that is left if that is known."""
    if p.left_s is None:
        return p.text
    what, comma, reason = p.text.partition(" (")
    return f"{what}, about {max(10.0 * round(p.left_s / 10.0), 10.0):.0f} s more{comma}{reason}"


def sentence(text: str) -> str:
    """Return a text with a capital letter and a full stop."""
    text = text.strip()
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", "!", "?")) else ".")
