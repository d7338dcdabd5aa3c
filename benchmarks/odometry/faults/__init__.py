"""What can befall the sensors, done to a simulated walk on purpose, and what the odometry made of it."""
