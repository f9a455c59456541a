"""An autopilot's parameters: how they travel, their effect on a stream, and the values that a calibration gives."""
