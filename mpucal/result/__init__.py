"""A calibration as a result: its files, its numbers in common units, its application, comparison and merging."""
