"""Changes of the gyroscope's bias while the board was turned, which are found by their evidence and removed."""

from __future__ import annotations

from typing import Protocol, TypeVar

import numpy as np

from .hypotheses import SURE, Explanation

MOST_CHANGES = 3  # each is what is left of a drift after the one before


class Fitted(Protocol):
    """Fit of a recording without the `changes` of the gyroscope's bias that were found so far."""

    @property
    def changes(self) -> tuple[Explanation, ...]:
        """Changes that were removed before the fit."""

    def cost(self) -> float:
        """Return the cost function (8) where the search ended."""

    def find_change(self) -> Explanation | None:
        """Return the change that explains what the fit leaves; None where there is none, or the search failed."""

    def without(self: F, change: Explanation) -> F:
        """Fit the recording without one more change."""


F = TypeVar("F", bound=Fitted)


def without_changes(fitted: F) -> F:
    """Return the fit without all changes of the gyroscope's bias that its evidence shows."""
    while len(fitted.changes) < MOST_CHANGES and (change := fitted.find_change()) is not None:
        without = fitted.without(change)
        # A change whose removal explains nothing is none.
        if not fitted.cost() - np.log(SURE) > without.cost():
            break
        fitted = without
    return fitted
