"""The operator's terminal interface: a client of the recorder's control socket, and of nothing else."""
