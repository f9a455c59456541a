"""Terminal: a session as a screen, as lines or as JSON, and the keys."""
