"""Trials: simulated or recorded sensors, calibrated and judged against what is known of them."""
