"""Sources of samples: the table of all kinds, buses to a chip, and captures."""
