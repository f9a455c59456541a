"""An autopilot's parameters: how they travel, what they do to a stream, what a calibration makes of them."""
