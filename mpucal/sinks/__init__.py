"""Write-back of a calibration: the table of sinks, what all of them share, and a chip's registers."""
