"""Writing of files and folders: atomically or as they grow, each by one process at a time."""
