"""What recording costs: CPU, losses, latency and memory of the recorder at the full rate, and against other writers."""
