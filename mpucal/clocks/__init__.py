"""Clocks of sensors: the times of samples from counts, stamps and arrivals, for every kind of source."""

# Nanoseconds in a microsecond, a millisecond and a second.
US, MS, S = 1_000, 1_000_000, 1_000_000_000
# Variance of what lies anywhere within a step of 1: a poll between two samples, or what rounding takes away.
UNIFORM = 1 / 12
