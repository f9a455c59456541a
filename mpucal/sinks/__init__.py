"""Where a calibration is written to."""
