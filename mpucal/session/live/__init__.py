"""Fits while a session goes on: requested and answered at fixed numbers of samples, so that replays repeat them."""
