"""Sensors with a Linux kernel (IIO) driver: their attributes, their buffers, and samples from them."""

# Version of the driver: it counts up with every change of its accesses.
IIO_VERSION = "iio 1"
