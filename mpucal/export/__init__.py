"""Export of a calibration to other programs; `forms` has a row for each form."""
