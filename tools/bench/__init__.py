"""Time and memory: how long things take, in one run beside what they are compared with."""
