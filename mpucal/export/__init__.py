"""A calibration in the form that somebody else's program reads. Each module is one form, and knows no other."""
