"""The terminal before the person: what is shown there, and what is pressed. Knows no rule of a session."""
