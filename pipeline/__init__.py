"""The algorithms: arrays and messages in, estimates and products out. Knows no socket, no MCAP and no UI."""
