"""Odometry against its peers, on simulated walks whose truth is known."""
