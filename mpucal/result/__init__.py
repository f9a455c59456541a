"""What a calibration is, and what is done with it: kept, applied, compared, merged."""
