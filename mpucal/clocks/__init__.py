"""Clocks of sensors: the times of samples from counts, stamps and arrivals, for every kind of source."""

# Nanoseconds in a microsecond, a millisecond and a second.
US, MS, S = 1_000, 1_000_000, 1_000_000_000
