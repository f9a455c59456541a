"""A guided session without its surroundings: what happens to it, what it answers, and what follows what."""
