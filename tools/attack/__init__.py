"""Hostile input: bytes, packets, system calls and floods that no reader, link or command may fail on."""
