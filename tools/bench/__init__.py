"""Time and memory: measurements, each in one run with what it is compared with."""
