"""The inventory of sessions and of other maps: from what was asked to files on the disk."""
