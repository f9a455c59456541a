"""A vehicle over MAVLink: its link, its streams and its parameters. pymavlink is imported when a link is opened."""

# Version of the source: it counts up with every change of what it sends and accepts.
MAVLINK_VERSION = "mavlink 4"
