"""The C++ kernel: the gravity filter with exact derivatives. Arrays in, arrays out."""
