"""A guided session without devices and screens: its states, events and outputs, and the fits while it goes on."""
