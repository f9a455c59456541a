"""Sensors that a driver of the Linux kernel holds (IIO): their attributes and buffers, and samples from them."""
