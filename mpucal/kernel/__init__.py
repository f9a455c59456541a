"""Kernel in C++: the gravity filter with exact derivatives. Arrays in, arrays out."""
