"""Tables of other programs: which column is what, in which unit, and how two tables become one recording."""
