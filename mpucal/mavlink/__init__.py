"""A vehicle over MAVLink: its link, its streams and its parameters. pymavlink loads where a link is opened."""
