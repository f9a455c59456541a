"""A vehicle over MAVLink as a source, with its examination and the write-back to its autopilot."""
