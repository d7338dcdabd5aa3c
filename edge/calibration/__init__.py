"""From recordings, pictures and videos to the calibration file."""
