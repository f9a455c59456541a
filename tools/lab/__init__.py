"""Trials: simulated or recorded sensors, calibrated and compared with their truth."""
