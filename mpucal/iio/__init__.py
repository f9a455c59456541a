"""Sensors that a driver of the Linux kernel holds (IIO): their attributes and buffers, and samples from them."""

# of the driver: counts up with every change of its accesses
IIO_VERSION = "iio 1"
