"""A simulated forest, and emulators that speak the real protocols of the sensors from it."""
