"""A calibration as a result: its files, its numbers in common units, applied, compared, merged."""
