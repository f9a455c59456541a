"""Programs for developers, by what they are for; `python -m tools.lab` lists those of a folder."""
