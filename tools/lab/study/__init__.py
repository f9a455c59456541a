"""Recordings with known truth: simulated sensors in simulated hands."""
