"""How a session's numbers and warnings are worded, on a screen as in lines. Knows neither."""

from __future__ import annotations

from dataclasses import dataclass

from ..session.events import Direction, Knowledge

# standard deviations from here on mean that nothing is known
UNKNOWN = 100.0


@dataclass(frozen=True)
class Group:
    """Parameters of one kind, of x, y and z: progress 0..1 and standard deviations, and what is wanted of these."""

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
        """How well it is known."""
        return f"±{rounded(self.std[axis])} {self.unit}" if self.std[axis] < UNKNOWN else "unknown"


def groups(k: Knowledge) -> tuple[Group, Group, Group]:
    """All that is wanted."""
    return (
        Group("gain", "%", k.gain, k.gain_pct, k.target.gain_pct),
        Group("misalignment", "deg", k.misalignment, k.misalignment_deg, k.target.misalignment_deg),
        Group("bias", "mg", k.bias, k.bias_mg, k.target.bias_mg),
    )


def known(k: Knowledge) -> str:
    """How well the worst of each group is known, and what is wanted."""
    said = ", ".join(f"{g.name} {g.said(g.worst)} (wanted {g.target:g})" for g in groups(k))
    return f"so far: {said}" + (f"; {k.doubt}" if k.doubt else "")


def rounded(value: float) -> str:
    """Two digits, and no exponent."""
    return f"{value:.0f}" if value >= 10.0 else f"{value:.2g}"


def sentence(text: str) -> str:
    """The same with a capital letter and a full stop."""
    text = text.strip()
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", "!", "?")) else ".")
