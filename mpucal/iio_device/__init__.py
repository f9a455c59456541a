"""IIO devices of the Linux kernel as a source, with their examination and the write-back to their driver."""
