"""Any recording with a LiDAR and an IMU as the drivers' messages, in order of time."""
