"""GNSS and odometry brought together: where `odom` lies on the Earth, live and after the session."""
