"""Livox Mid-360 LiDAR with its IMU, spoken to over UDP without any SDK."""
