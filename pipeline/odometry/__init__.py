"""LiDAR-inertial odometry: an iterated error-state Kalman filter over a bounded voxel map."""
