"""What is handed out: trajectory, covariance and map in the formats that others open. Arrays in, files out."""
