"""Chips above any bus: the table of chips, the registers, the FIFO, the sample clock and the driver."""
