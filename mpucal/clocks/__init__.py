"""Clocks of sensors: the times of samples from counts, stamps and arrivals, for every kind of source."""
