"""What lies over the main screen when asked for."""
