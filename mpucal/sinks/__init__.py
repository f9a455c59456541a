"""Where a calibration is written to besides files: a chip's registers, a bridge's memory, an autopilot."""
