"""How every command ends."""

GOOD = 0
FAILED = 1
USAGE = 2
WARNINGS = 3
"""Done, with something to look at."""
