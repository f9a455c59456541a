"""What is the matter with a chip and its bus: examined step by step, told on one page."""
