"""A vehicle over MAVLink: its link, its streams and its parameters. pymavlink is imported when a link is opened."""
