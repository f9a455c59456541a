"""Files and folders on their way to the disk: written whole or as they grow, each by one process at a time."""
