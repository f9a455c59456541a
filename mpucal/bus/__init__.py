"""The buses: each moves register reads and writes, and carries the time. Knows no chip's meaning."""
