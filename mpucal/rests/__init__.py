"""Rests of a board: where it lies flat or is held still, how a hand rests, and the gyroscope's bias there."""
