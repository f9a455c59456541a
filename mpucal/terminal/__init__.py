"""The terminal: what a session shows on it, as a screen, as lines or as JSON, and which keys are pressed."""
