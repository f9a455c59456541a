"""Simulated world: a sensor, a hand, a chip, a serial bridge and a vehicle."""
