"""The page: a session as a phone or laptop in the other hand shows it, served while the session lasts."""
