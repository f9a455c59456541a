"""Simulated world: a sensor, a hand, a chip, a driver of the kernel and a vehicle."""
