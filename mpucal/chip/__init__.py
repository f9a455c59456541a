"""The chip above any bus: its register map, its FIFO, its clock and the driver. Knows no bus."""
