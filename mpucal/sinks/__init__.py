"""Sinks of a calibration besides files: a chip's registers, a kernel driver, a bridge's memory, an autopilot."""
