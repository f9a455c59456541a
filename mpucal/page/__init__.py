"""Page in a browser that shows a session on a phone or laptop, served while the session lasts."""
