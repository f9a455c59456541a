"""A calibration in the forms that other programs read; `forms` has a row for each."""
