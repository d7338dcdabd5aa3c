"""Lens, camera-LiDAR pose and time offset from what the payload itself saw."""
