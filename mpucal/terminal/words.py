"""The wording of uncertainties and cautions, the same on the screen and in lines."""

from __future__ import annotations

from dataclasses import dataclass

from ..report.units import UNKNOWN
from ..session.events import Direction, Knowledge


@dataclass(frozen=True)
class Group:
    """Parameters of one kind, of x, y and z: progress 0..1, standard uncertainties (1 sigma), and their target."""

    name: str
    unit: str
    progress: Direction
    std: Direction
    target: float

    @property
    def worst(self) -> int:
        """The axis that is farthest from its target."""
        return min(range(3), key=lambda i: self.progress[i])

    def said(self, axis: int) -> str:
        """The uncertainty of an axis in words."""
        return f"±{rounded(self.std[axis])} {self.unit}" if self.std[axis] < UNKNOWN else "not observable"


def groups(k: Knowledge) -> tuple[Group, Group, Group]:
    """Scale factor error, misalignment and bias."""
    return (
        Group("scale factor error", "%", k.gain, k.gain_pct, k.target.gain_pct),
        Group("misalignment", "deg", k.misalignment, k.misalignment_deg, k.target.misalignment_deg),
        Group("bias", "mg", k.bias, k.bias_mg, k.target.bias_mg),
    )


def known(k: Knowledge) -> str:
    """The largest uncertainty of each group, and its target."""
    said = ", ".join(f"{g.name} {g.said(g.worst)} (target {g.target:g})" for g in groups(k))
    return f"1 sigma: {said}" + (f"; {k.doubt}" if k.doubt else "")


def rounded(value: float) -> str:
    """Two digits, and no exponent."""
    return f"{value:.0f}" if value >= 10.0 else f"{value:.2g}"


def sentence(text: str) -> str:
    """The same with a capital letter and a full stop."""
    text = text.strip()
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", "!", "?")) else ".")
